"""Users' objects are told apart by what they are, whatever their classes say."""

import gc

import pytest

from smach_oracle.oracle.identity import (
    WeakIdentityMap,
    attribute_of,
    name_of,
    own_attributes,
    remove_identical,
)


class EqualToAll:
    """Equals everything, and raises where it is asked for its hash or its name."""

    def __eq__(self, other: object) -> bool:
        return True

    def __hash__(self) -> int:
        raise TypeError('it has no hash')

    @property
    def __name__(self) -> str:
        raise ValueError('it has no name')

    def __call__(self) -> None:
        pass


class Slotted:
    """Has no dictionary of attributes."""

    __slots__ = ('state',)


@pytest.fixture(name='both')
def two_equal_things():
    return EqualToAll(), EqualToAll()


def test_a_map_has_values_by_object(both):
    one, other = both
    found = WeakIdentityMap()
    found[one] = 1
    assert (one in found, other in found) == (True, False)
    assert (found.get(one), found.get(other)) == (1, None)
    assert [each is one for each in found] == [True]


def test_a_map_forgets_what_it_is_told_to_and_nothing_else(both):
    one, other = both
    found = WeakIdentityMap()
    found[one] = 1
    found.forget(other)
    assert found.get(one) == 1
    found.forget(one)
    found.forget(one)
    assert one not in found
    found[one], found[other] = 1, 2
    found.clear()
    assert not [*found]


def test_an_entry_ends_with_its_object():
    found = WeakIdentityMap()
    kept, gone = EqualToAll(), EqualToAll()
    found[kept], found[gone] = 1, 2
    del gone
    gc.collect()
    assert [each is kept for each in found] == [True]


def test_an_object_is_taken_out_of_a_list_once(both):
    one, other = both
    items = [other, one, other]
    assert remove_identical(items, one)
    assert [each is other for each in items] == [True, True]
    assert not remove_identical(items, one)
    assert remove_identical(items, other)
    assert len(items) == 1


def test_what_a_class_refuses_to_say_is_nothing(both):
    assert own_attributes(Slotted()) == {}
    assert attribute_of(both[0], '__name__') is None
    assert attribute_of(both[0], 'missing') is None
    assert name_of(both[0]) == 'EqualToAll'
    assert name_of(two_equal_things) == 'two_equal_things'
