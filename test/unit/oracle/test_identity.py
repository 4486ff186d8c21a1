"""Users' objects are told apart by what they are, whatever their classes say."""

import gc
import sys
import weakref

import pytest

from smach_oracle.oracle.identity import (
    WeakIdentityMap,
    attribute_of,
    is_same,
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
    kept, gone, value = EqualToAll(), EqualToAll(), EqualToAll()
    found[kept], found[gone] = 1, value
    with_it = weakref.ref(value)
    del gone, value
    gc.collect()
    assert [each is kept for each in found] == [True]
    assert with_it() is None


def test_an_entry_that_is_dropped_while_all_are_gone_through_ends_quietly(monkeypatch):
    raised = []
    monkeypatch.setattr(sys, 'unraisablehook', raised.append)
    found = WeakIdentityMap()
    first, second = EqualToAll(), EqualToAll()
    found[first], found[second] = 1, 2
    each = iter(found)
    assert next(each) is first
    found.forget(first)
    del first
    assert next(each) is second
    assert not raised and second in found


def test_an_object_is_taken_out_of_a_list_once(both):
    one, other = both
    items = [other, one, other]
    assert remove_identical(items, one)
    assert [each is other for each in items] == [True, True]
    assert not remove_identical(items, one)
    assert remove_identical(items, other)
    assert len(items) == 1


@pytest.mark.parametrize('name', ['', None, 7])
def test_what_has_no_name_goes_by_that_of_its_class(name):
    slotted = EqualToAll()
    slotted.__class__ = type('Named', (), {'__name__': name})
    assert name_of(slotted) == 'Named'


def test_what_a_class_refuses_to_say_is_nothing(both):
    assert own_attributes(Slotted()) == {}
    assert attribute_of(both[0], '__name__') is None
    assert attribute_of(both[0], 'missing') is None
    assert name_of(both[0]) == 'EqualToAll'
    assert name_of(two_equal_things) == 'two_equal_things'


def test_plain_data_are_the_same_as_no_object_that_says_so():
    assert is_same('cup', ''.join(('c', 'up'))) and is_same([1, {'a': 'b'}], [1, {'a': 'b'}])
    assert not is_same('cup', EqualToAll()) and not is_same(EqualToAll(), 'cup')
    assert not is_same(EqualToAll(), EqualToAll())


class Arm:
    """Two of them are two."""

    def move(self):
        """Do nothing."""

    def stop(self):
        """Do nothing either."""


ARM, OTHER = Arm(), Arm()


@pytest.mark.parametrize(
    'one, other',
    [
        ([ARM], [ARM, ARM]),
        ([ARM, ARM], [ARM]),
        ([ARM, 1], [ARM, 2]),
        ([ARM], (ARM,)),
        ([ARM], [OTHER]),
        ({'a': ARM}, {'a': ARM, 'b': 1}),
        ({'a': ARM, 'b': 1}, {'a': ARM}),
        ({'a': ARM}, {'b': ARM}),
        ({'a': ARM}, {'a': OTHER}),
        (ARM.move, OTHER.move),
        (ARM.move, ARM.stop),
        (ARM, OTHER),
        (1, [1]),
        ([], {}),
    ],
)
def test_what_differs_somewhere_inside_is_not_the_same(one, other):
    assert not is_same(one, other) and not is_same(other, one)


class Proxy:
    """Says that it is of the class of what it stands for."""

    def __init__(self, wrapped):
        self.wrapped = wrapped

    @property
    def __class__(self):
        return type(self.wrapped)

    def __getattr__(self, name):
        return getattr(self.wrapped, name)


@pytest.mark.parametrize('one', [[ARM], (ARM,), {'a': ARM}, ARM.move])
@pytest.mark.parametrize('other', [5, None])
def test_proxies_of_different_kinds_are_not_the_same(one, other):
    assert not is_same(Proxy(one), Proxy(other)) and not is_same(Proxy(other), Proxy(one))


@pytest.mark.parametrize('make', [lambda: [ARM, 'a'], lambda: (ARM, [1]), lambda: {'a': [ARM]}])
def test_lists_and_mappings_of_the_same_are_the_same(make):
    assert is_same(make(), make()) and is_same(ARM.move, ARM.move)
