"""Identity of users' objects, and their own attributes, found without running users' code.

A user's class may define `__eq__`, `__hash__`, `__bool__` or `__getattr__` to its own ends, and may
raise there. A machine, a state, a function or a message is itself, and equal to nothing else.
"""

import inspect
import types
import weakref
from typing import Dict, Generic, Iterator, List, Optional, Tuple, TypeVar

Key = TypeVar('Key')
Value = TypeVar('Value')
_MISSING = object()
_PLAIN = (str, int, float, bool, type(None), bytes)


class WeakIdentityMap(Generic[Key, Value]):
    """Values by object, and not by what the object compares equal to.

    An entry lasts as long as its object. Safe to use from several threads.
    """

    def __init__(self) -> None:
        self._entries: Dict[int, Tuple['weakref.ref[Key]', Value]] = {}

    def __setitem__(self, key: Key, value: Value) -> None:
        number, entries = id(key), self._entries

        def forget(gone: 'weakref.ref[Key]') -> None:
            kept = entries.get(number)
            if kept is not None and kept[0] is gone:
                entries.pop(number, None)

        entries[number] = weakref.ref(key, forget), value

    def get(self, key: Key) -> Optional[Value]:
        """Return the value of an object, None where there is none."""
        kept = self._entries.get(id(key))
        return kept[1] if kept is not None and kept[0]() is key else None

    def forget(self, key: Key) -> None:
        """Drop the entry of an object, if there is one."""
        if key in self:
            self._entries.pop(id(key), None)

    def clear(self) -> None:
        """Drop all entries."""
        self._entries.clear()

    def __contains__(self, key: Key) -> bool:
        kept = self._entries.get(id(key))
        return kept is not None and kept[0]() is key

    def __iter__(self) -> Iterator[Key]:
        """Go through the objects that still live."""
        for reference, _ in list(self._entries.values()):
            key = reference()
            if key is not None:
                yield key


def remove_identical(items: List[Value], item: object) -> bool:
    """Take an object out of a list, once. Return whether it was there."""
    for index, each in enumerate(items):
        if each is item:
            del items[index]
            return True
    return False


def is_same(one: object, other: object) -> bool:
    """Whether two values are the same object, equal plain data, or lists of what is the same.

    A method is the same as another access to it.
    """
    if one is other:
        return True
    if type(one) in _PLAIN and type(other) in _PLAIN:
        return one == other
    if type(one) is not type(other):
        return False
    if isinstance(one, types.MethodType) and isinstance(other, types.MethodType):
        return one.__self__ is other.__self__ and one.__func__ is other.__func__
    if isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        return len(one) == len(other) and all(map(is_same, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return len(one) == len(other) and all(
            key in other and is_same(value, other[key]) for key, value in one.items()
        )
    return False


def is_hashable(value: object) -> bool:
    """Whether an object may be a key."""
    try:
        hash(value)
    except TypeError:
        return False
    return True


def truth_of(value: object) -> Optional[bool]:
    """Return whether a value counts as true, None where its class does not say, as an array's."""
    try:
        return bool(value)
    except Exception:
        return None


def own_attributes(thing: object) -> Dict[str, object]:
    """Return the attributes that were set on an object itself, empty for one that has slots.

    Neither its class nor its `__getattr__` is asked.
    """
    try:
        attributes: Dict[str, object] = object.__getattribute__(thing, '__dict__')
    except AttributeError:
        return {}
    return attributes


def own_mark(thing: object, name: str) -> object:
    """Return an attribute that was set on an object itself, None where none was."""
    return own_attributes(thing).get(name)


def set_class(thing: object, cls: type) -> None:
    """Make an object one of another class, whatever its own says of `__class__` and `__setattr__`.

    :raises TypeError: where the two classes do not fit.
    """
    vars(object)['__class__'].__set__(thing, cls)
    renew_attributes(thing)


def renew_attributes(thing: object) -> None:
    """Give an object a fresh dictionary of its attributes.

    CPython reads from it much faster than from one that was looked at, or whose object has changed
    its class.
    """
    object.__setattr__(thing, '__dict__', dict(own_attributes(thing)))


def has_attribute(thing: object, name: str) -> bool:
    """Whether an object or its class has an attribute. Its `__getattr__` is not asked."""
    return inspect.getattr_static(thing, name, _MISSING) is not _MISSING


def attribute_of(thing: object, name: str) -> object:
    """Return an attribute that an object or its class has.

    It is None where there is none, and where the attribute is a property that raises.
    """
    if not has_attribute(thing, name):
        return None
    try:
        return getattr(thing, name)
    except Exception:  # a property of a user's
        return None


def name_of(function: object) -> str:
    """Return the name of a function, or that of its class where it has none."""
    try:
        name = getattr(function, '__name__', None)
    except Exception:  # of an object that can be called
        name = None
    return name if isinstance(name, str) and name else str(type(function).__name__)
