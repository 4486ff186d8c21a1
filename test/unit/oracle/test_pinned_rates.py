"""What becomes of a rates file with a part of another value does not change, on each engine.

Where users are meant to see a change, `python3 test/unit/support/pinned_rates.py FOLDER --pin`
writes all again (test/data/pinned/README.md).
"""

import pinned_rates
import pytest
from pinned import digests_of, held


@pytest.fixture(scope='module')
def told():
    return pinned_rates.tell()


def test_rates_files_are_taken_over_refused_and_written_as_they_were(told):
    assert digests_of(told) == held('rates')


def test_they_are_told_in_full(told):
    (place,) = [each for each in told if each.endswith('machines/T//L1/failures') and '577' in each]
    (said,) = [each for each in told[place] if each.startswith('inf: WARN') and 'L1' in each][:1]
    assert 'successes, failures: ' in said and 'are not counts' in said
