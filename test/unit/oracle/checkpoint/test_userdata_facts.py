"""Userdata of which only what has changed is stored."""
import pytest

from smach_oracle.oracle.checkpoint.storable import CODECS
from smach_oracle.oracle.checkpoint.userdata_facts import UserdataFacts


@pytest.mark.parametrize('before, after', [
    ([b'ab'], [bytearray(b'ab')]), ([1], [1.0]), ([1], [True]), ([[1]], [(1,)]), ([''], [None])])
def test_data_that_look_alike_are_told_apart(before, after):
    facts = UserdataFacts(CODECS, 'TOP', lambda kept: None)
    assert len(list(facts.changed({'x': before}, None))) == 1
    assert list(facts.changed({'x': list(before)}, None)) == []
    assert len(list(facts.changed({'x': after}, None))) == 1
