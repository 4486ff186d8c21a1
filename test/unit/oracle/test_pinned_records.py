"""What is remembered of drawn visits, ways and streaks does not change, nor what events say.

Where users are meant to see a change, `python3 test/unit/support/pinned_records.py FOLDER --pin`
writes all again (test/data/pinned/README.md).
"""

import pinned_records
import pytest
from pinned import digests_of, held


@pytest.fixture(scope='module')
def told():
    return pinned_records.tell()


def test_visits_ways_and_streaks_are_remembered_as_they_were(told):
    assert digests_of(told) == held('records')


def test_they_are_told_in_full(told):
    lines = [line for lines in told.values() for line in lines]
    for words in ('failing_since=True', "moved='from A'", 'failing_outcome aborted: no object'):
        assert any(words in line for line in lines)
