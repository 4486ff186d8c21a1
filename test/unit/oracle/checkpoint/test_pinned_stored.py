"""What is stored of drawn userdata, records and marks does not change, nor what is read of it.

Where users are meant to see a change, `python3 test/unit/support/pinned_stored.py FOLDER --pin`
writes all again (test/data/pinned/README.md).
"""

import pinned_stored
import pytest
from pinned import digests_of, held


@pytest.fixture(scope='module')
def told():
    return pinned_stored.tell()


def test_userdata_records_and_structures_are_stored_and_read_as_they_were(told):
    assert digests_of(told) == held('stored')


def test_they_are_told_in_full(told):
    lines = [line for lines in told.values() for line in lines]
    for words in ("key:a: gone', 'T out:a: ", 'history: ["A"', "'spent': True", ' is gone"'):
        assert any(words in line for line in lines), words
