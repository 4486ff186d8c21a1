"""Checks of single settings. Pure.

Each takes the dotted key and the value, and returns the value or raises SettingsError.
"""

import math
from typing import Any, Callable, Collection, Mapping, Optional, Sequence, Tuple

from ..errors import SettingsError
from ..identity import attribute_of
from ..number_checks import is_number, is_whole
from .paths import path_of
from .written import as_text, as_value, read_otherwise

Check = Callable[[str, object], Any]


def is_state(value: object) -> bool:
    """Whether `value` is a state in smach's sense, told without importing smach."""
    names = ('execute', 'get_registered_outcomes')
    if all(callable(attribute_of(value, name)) for name in names):
        return True
    if callable(value):
        return False  # a function, also one that answers to every name
    try:  # what stands for a state that is elsewhere
        return all(callable(getattr(value, name)) for name in names)
    except Exception:
        return False


def number(low: float, high: float, allowed: str) -> Check:
    """Check for a number from `low` to `high`. Its SettingsError says `allowed`."""

    def check(key: str, value: Any) -> float:
        if not is_number(value, low, high):
            raise SettingsError(key, value, allowed)
        return float(value)

    return check


def whole(low: int, allowed: str, high: float = math.inf) -> Check:
    """Check for a whole number from `low` to `high`. Its SettingsError says `allowed`."""

    def check(key: str, value: Any) -> int:
        if not is_whole(value, low, high):
            raise SettingsError(key, value, allowed)
        return int(value)

    return check


def flag(key: str, value: object) -> bool:
    """Check for true or false.

    :raises SettingsError: for anything else.
    """
    found = as_value(value)
    if not isinstance(found, bool):
        raise SettingsError(key, value, 'true or false')
    return found


def no_name(key: str, value: object, allowed: str) -> SettingsError:
    """Return the error for a value that is no name, and say how YAML may have made it of one."""
    return SettingsError(key, value, allowed, problem='is not allowed' + read_otherwise(value))


def choice(options: Sequence[str]) -> Check:
    """Check for one of some words. Its SettingsError names them all."""

    def check(key: str, value: object) -> str:
        word = as_text(value)
        if not isinstance(word, str) or word not in options:
            raise no_name(key, value, ', '.join(options))
        return word

    return check


def text(key: str, value: object) -> str:
    """Check for a string, empty or not.

    :raises SettingsError: for anything else.
    """
    found = as_text(value)
    if not isinstance(found, str):
        raise no_name(key, value, 'a string')
    return found


def file(key: str, value: object) -> str:
    """Check for a path, empty or not, and return it with `~` filled in."""
    return path_of(text(key, value))


def label(key: str, value: object) -> str:
    """Check for a string that is not empty.

    :raises SettingsError: for anything else.
    """
    found = as_text(value)
    if not isinstance(found, str) or not found:
        raise no_name(key, value, 'a string that is not empty')
    return found


def words(key: str, value: object) -> Tuple[str, ...]:
    """Check for a list of strings, none of them empty.

    :raises SettingsError: for anything else.
    """
    if isinstance(value, str) or not isinstance(value, (list, tuple, set, frozenset)):
        raise SettingsError(key, value, 'a list of strings')
    found = []
    for entry in value:
        word = as_text(entry)
        if not isinstance(word, str) or not word:
            raise no_name(key, entry, 'a list of strings, none of them empty')
        found.append(word)
    return tuple(sorted(found)) if isinstance(value, (set, frozenset)) else tuple(found)


def optional(check: Check) -> Check:
    """Check that admits None (nothing set) beside what `check` admits."""

    def checked(key: str, value: object) -> object:
        return None if as_value(value) is None else check(key, value)

    return checked


def mapping(key: str, value: object) -> Mapping[str, Any]:
    """Check for a mapping whose keys are strings.

    None, an empty section of a YAML file, counts as an empty one.

    :raises SettingsError: naming the value, or the key that is no string.
    """
    if as_value(value) is None:
        return {}
    if not isinstance(value, Mapping):
        raise SettingsError(key, value, 'a mapping')
    for name in value:
        if not isinstance(name, str):
            raise no_name(key, name, 'names that are strings')
    return value


def section(key: str, value: object, allowed: Collection[str]) -> Mapping[str, Any]:
    """Check for a mapping that has none but these keys.

    :raises SettingsError: as `mapping`, or naming the first other key.
    """
    found = mapping(key, value)
    for name in found:
        if name not in allowed:
            keys = 'one of the keys ' + ', '.join(allowed)
            raise SettingsError('{}.{}'.format(key, name), found[name], keys)
    return found


def on_no_answer(key: str, value: object) -> Tuple[str, str]:
    """Check for a fallback.

    Allowed: 'stop', 'goto:LABEL', 'give_up:OUTCOME', or a mapping of one of these words.

    :returns: the word, and what it names or ''.
    :raises SettingsError: for anything else.
    """
    verb: object
    target: object
    if isinstance(value, Mapping) and len(value) == 1:
        ((verb, target),) = value.items()
        target = as_text(target)
    elif isinstance(value, str):
        verb, _, target = value.partition(':')
    elif isinstance(value, tuple) and len(value) == 2:
        verb, target = value
    else:
        verb, target = None, None
    named = isinstance(target, str) and bool(target)
    if (verb == 'stop' and not target) or (verb in ('goto', 'give_up') and named):
        return str(verb), str(target or '')
    how_read = read_otherwise(target) if verb in ('goto', 'give_up') else ''
    raise SettingsError(
        key,
        value,
        "'stop', {'goto': LABEL} or {'give_up': OUTCOME}",
        problem='is not allowed' + how_read,
    )


deadline = number(0, math.inf, 'seconds from 0; 0 waits without end')
_limit = optional(number(0, math.inf, 'seconds from 0; 0 is no limit'))


def time_limit(key: str, value: object) -> Optional[float]:
    """Check for a time limit in seconds. 0 and None are no limit.

    :raises SettingsError: for anything else.
    """
    return _limit(key, value) or None
