"""Names of states and containers in settings: labels, paths, and patterns of them. Pure.

A name without '/' is a label, in any container. One with '/' is a path below the top machine. In
both `*` stands for any part of one label. In a path `**` stands for any number of labels.
"""

import functools
import re
from typing import List, Tuple, Union

from ..errors import SettingsError
from .checks import words
from .written import as_value

ANY_LABELS = '**'
Nested = Union[bool, Tuple[str, ...]]


def is_pattern(name: str) -> bool:
    """Whether a name stands for more than one state."""
    return '*' in name


def check_name(key: str, name: str) -> str:
    """Return a name of states.

    :raises SettingsError: for a pattern that says nothing clear.
    """
    if any(ANY_LABELS in part and part != ANY_LABELS for part in name.split('/')):
        raise SettingsError(
            key,
            name,
            "a name in which '**' stands alone between two '/', for "
            "whole labels; '*' is a part of one",
        )
    return name


def checked_nested(key: str, value: object) -> Nested:
    """Return whether, or at which paths, nested containers have oracles.

    :raises SettingsError: for what is neither true or false nor a list of names.
    """
    given = as_value(value)
    if isinstance(given, bool):
        return given
    if not isinstance(value, (list, tuple)):
        raise SettingsError(key, value, 'true, false, or a list of paths and patterns')
    return tuple(check_name(key, name) for name in words(key, value))


def is_nested_at(nested: Nested, path: str) -> bool:
    """Whether a container or a branch at a path below the top machine has an oracle."""
    return nested if isinstance(nested, bool) else any(matches(name, path) for name in nested)


def matches(name: str, path: str) -> bool:
    """Whether a name stands for the state or container of a path. '' is the top machine's."""
    label = path.rsplit('/', 1)[-1]
    if name in (path, label):
        return True
    if not is_pattern(name):
        return False
    return _expression(name).fullmatch(path if _is_path(name) else label) is not None


def exactness(name: str) -> Tuple[bool, bool, int, int]:
    """Return what sorts names by how exact they are, the most exact last.

    A name without `*` is more exact than a pattern, and a path is more exact than a label. Of two
    patterns the one with more letters is, then the one with fewer `**`.
    """
    return (
        not is_pattern(name),
        _is_path(name),
        len(name.replace('*', '').replace('/', '')),
        -name.split('/').count(ANY_LABELS),
    )


def _is_path(name: str) -> bool:
    return '/' in name or name == ANY_LABELS


@functools.lru_cache(maxsize=1024)
def _expression(name: str) -> 're.Pattern[str]':
    """Return the regular expression of a pattern."""
    parts = name.split('/')
    found: List[str] = []
    for index, part in enumerate(parts):
        is_last = index == len(parts) - 1
        if part == ANY_LABELS:
            found.append('.+' if is_last else '(?:[^/]+/)*')
        else:
            one = '[^/]*'.join(re.escape(each) for each in part.split('*'))
            found.append(one if is_last else one + '/')
    return re.compile(''.join(found), re.DOTALL)
