"""What becomes of each setting with each kind of value does not change: a value, or a refusal.

Where users are meant to see a change, `python3 test/unit/support/pinned_settings.py FOLDER --pin`
writes all again (test/data/pinned/README.md).
"""

import pinned_settings
import pytest
from pinned import digests_of, held


@pytest.fixture(scope='module')
def told():
    return pinned_settings.tell()


def test_settings_are_taken_and_refused_as_they_were(told):
    assert digests_of(told) == held('settings')


def test_they_are_told_in_full(told):
    refused = (
        'True: refused: memory: True is not allowed; allowed: a whole number of results from 1'
    )
    taken = "3: states={'A': {'memory': 3}}, A.memory=3, ARM/A.memory=3, ARM/HAND/A.memory=3"
    assert refused in told['top memory'] and taken in told['state memory']
    assert any('did you mean memory?' in line for line in told['typos memory'])
