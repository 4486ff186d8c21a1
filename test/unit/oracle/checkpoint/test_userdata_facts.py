"""Userdata of which only what has changed is stored."""

from dataclasses import dataclass

import pytest

from smach_oracle.oracle.checkpoint.container_facts import UserdataFacts, WeakIds


@pytest.mark.parametrize(
    'before, after',
    [
        # of bytes that nothing else holds, what marshal writes is what it writes of a bytearray
        (lambda: [bytes(2)], lambda: [bytearray(2)]),
        (lambda: [bytes(10000)], lambda: [bytearray(10000)]),
        (lambda: ['x' * 10000, bytes(2)], lambda: ['x' * 10000, bytearray(2)]),
        (lambda: [1], lambda: [1.0]),
        (lambda: [1], lambda: [True]),
        (lambda: [[1]], lambda: [(1,)]),
        (lambda: [''], lambda: [None]),
    ],
)
def test_data_that_look_alike_are_told_apart(before, after):
    facts = UserdataFacts('TOP', lambda kept: None)
    assert len(list(facts.changed({'x': before()}, None))) == 1
    assert len(list(facts.changed({'x': after()}, None))) == 1


def test_data_that_are_equal_are_not_stored_again():
    facts = UserdataFacts('TOP', lambda kept: None)
    for number in (1, 0, 0):
        data = {'x': [bytes(2), {'y': [1, 'text']}], 'z': 'text'}
        assert len(list(facts.changed(data, None))) == number * 2


@dataclass
class Cup:
    size: int


def test_each_attribute_that_is_not_stored_is_named_once():
    one, other = Cup(1), Cup(2)
    one.owner = other.owner = other.colour = 'red'
    told = []
    list(UserdataFacts('TOP', told.append).changed({'cups': [one, other]}, None))
    assert [each.attributes for each in told] == [('colour', 'owner')]


def test_an_object_is_new_though_another_one_had_its_id():
    seen, gone, kept = WeakIds(), Cup(1), []
    assert (seen.add(gone), seen.add(gone)) == (True, False)
    number = id(gone)
    del gone
    while not kept or id(kept[-1]) != number:  # a new object soon has the place of one that is gone
        kept.append(Cup(2))
    assert (seen.add(kept[-1]), seen.add(kept[-1])) == (True, False)
