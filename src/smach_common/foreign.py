"""Looks at objects of other people's classes, which may do anything as they are looked at."""

import threading
from typing import Any


def ends_program(err: BaseException) -> bool:
    """Whether an error asks the program to end, so that it is no fault of the object looked at.

    A signal handler raises Ctrl-C, or what a `sys.exit` in it raises, in the main thread alone.
    """
    return (
        issubclass(type(err), (KeyboardInterrupt, SystemExit))
        and threading.current_thread() is threading.main_thread()
    )


def text_of(value: object) -> str:
    """Return `str(value)`, or the name of its type where that raises."""
    try:
        return str.__str__(str(value))  # and not a subclass of it
    except BaseException as err:
        if ends_program(err):
            raise
        return '({} without a text)'.format(type_name(value))


def repr_of(value: object) -> str:
    """Return `repr(value)`, or the name of its type where that raises."""
    try:
        return str.__str__(repr(value))
    except BaseException as err:
        if ends_program(err):
            raise
        return '({} without a text)'.format(type_name(value))


def error_text(err: BaseException) -> str:
    """Return the type and the text of an error."""
    return '{}: {}'.format(qualname_of(type(err)).rpartition('.')[2], text_of(err))


def type_name(value: object) -> str:
    """Return module and name of a value's type."""
    return class_name(type(value))


def class_name(kind: type) -> str:
    """Return module and name of a class, whatever its metaclass says of them."""
    return '{}.{}'.format(module_of(kind), qualname_of(kind))


def module_of(kind: type) -> str:
    """Return the name of the module of a class."""
    return _own(kind, '__module__')


def qualname_of(kind: type) -> str:
    """Return the name of a class within its module."""
    return _own(kind, '__qualname__')


def _own(kind: type, word: str) -> str:
    described: Any = vars(type)[word]
    try:
        found = described.__get__(kind)
    except AttributeError:  # its author has deleted it
        found = None
    return str.__str__(found) if issubclass(type(found), str) else '?'
