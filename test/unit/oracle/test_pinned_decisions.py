"""What each policy does in drawn situations does not change, nor what is learned of results.

Where users are meant to see a change, `python3 test/unit/support/pinned_decisions.py FOLDER --pin`
writes all again (test/data/pinned/README.md).
"""

import pinned_decisions
import pytest
from pinned import digests_of, held


@pytest.fixture(scope='module')
def told():
    return pinned_decisions.tell()


def test_policies_decide_and_states_are_learned_of_as_they_were(told):
    assert digests_of(told) == held('decisions')


def test_they_are_told_in_full(told):
    lines = [line for name in told if name.startswith('situations') for line in told[name]]
    remarks = 'attempts have not helped', 'all ways are tried', 'were expected'
    assert all(any(remark in line for line in lines) for remark in remarks)
    moved = [line for line in lines if ': learned' in line and 'hoped=0.' in line]
    assert len(moved) > 20
