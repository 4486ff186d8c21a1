"""The names of classes, and what an object has, whatever its class says of itself."""

import contextlib
import sys
from types import MemberDescriptorType
from typing import Any, Iterator

from smach_common.foreign import module_of, qualname_of

_IN_PYTHON = 1 << 9  # the flag of a class that no C code has laid out


def name_of(kind: type) -> str:
    """Return the name of a class as a store has it."""
    return '{}:{}'.format(module_of(kind), qualname_of(kind))


def found_by_name(name: str) -> Any:
    """Return what stands at a place of the program that runs. Nothing is imported for it."""
    module, _, path = name.partition(':')
    there: Any = sys.modules.get(module)
    for part in path.split('.'):
        there = getattr(there, part, None)
    return there


def has(kind: type, name: str) -> bool:
    """Whether a class has an attribute. What a metaclass makes up does not count."""
    return any(name in vars(each) for each in kind.__mro__)


def class_attribute(kind: type, name: str) -> object:
    """Return an attribute of a class as it stands there, None where it has none."""
    return next((vars(each)[name] for each in kind.__mro__ if name in vars(each)), None)


def is_only_attributes(kind: type) -> bool:
    """Whether an object of a class has attributes alone, unlike one of a list's subclass."""
    return all(each.__flags__ & _IN_PYTHON for each in kind.__mro__[:-1])


def is_set(value: object, name: str) -> bool:
    """Whether an object has a value for a field, its own or that of its class."""
    try:
        getattr(value, name)
    except AttributeError:
        return False
    return True


def attributes(value: object, kind: type) -> Iterator[str]:
    """Yield the names of the attributes of an object itself, those in slots among them."""
    with contextlib.suppress(AttributeError):
        yield from map(str, list(object.__getattribute__(value, '__dict__')))
    for each in kind.__mro__:
        for name, there in dict(vars(each)).items():
            if isinstance(there, MemberDescriptorType) and is_set(value, name):
                yield name
