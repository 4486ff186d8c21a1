"""Userdata of which only what has changed is stored."""

import pytest

from smach_oracle.oracle.checkpoint.container_facts import UserdataFacts
from smach_oracle.store.codecs import CODECS


@pytest.mark.parametrize(
    'before, after',
    [
        # of bytes that nothing else holds, what marshal writes is what it writes of a bytearray
        (lambda: [bytes(2)], lambda: [bytearray(2)]),
        (lambda: [bytes(10000)], lambda: [bytearray(10000)]),
        (lambda: [1], lambda: [1.0]),
        (lambda: [1], lambda: [True]),
        (lambda: [[1]], lambda: [(1,)]),
        (lambda: [''], lambda: [None]),
    ],
)
def test_data_that_look_alike_are_told_apart(before, after):
    facts = UserdataFacts(CODECS, 'TOP', lambda kept: None)
    assert len(list(facts.changed({'x': before()}, None))) == 1
    assert len(list(facts.changed({'x': after()}, None))) == 1


def test_data_that_are_equal_are_not_stored_again():
    facts = UserdataFacts(CODECS, 'TOP', lambda kept: None)
    for number in (1, 0, 0):
        data = {'x': [bytes(2), {'y': [1, 'text']}], 'z': 'text'}
        assert len(list(facts.changed(data, None))) == number * 2
