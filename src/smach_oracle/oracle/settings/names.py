"""Names of states and containers: labels, paths, and patterns of them. Pure.

In settings a name without '/' is a label, in any container. One with '/' is a path below the top
machine. In both `*` stands for any part of one label. In a path `**` stands for any number of
labels. An operator names states by a `PathPattern`.
"""

import fnmatch
import functools
import re
from difflib import get_close_matches
from enum import Enum
from typing import Callable, Iterable, List, NamedTuple, Sequence, Tuple, Union

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
    label = path.rpartition('/')[2]
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


class UnfitKind(Enum):
    """What follows where nothing has the name."""

    NAME = 'a setting has no effect'
    PROTECTION = 'a state runs where its author forbids or limits it'
    PRECONDITION = 'a precondition is never met in one container'
    MISPLACED = 'a precondition is never met in the whole machine'
    # only a check of all settings reports it: it is reported when it is used, if it ever is
    CHECKED = 'a setting has no effect now'
    # the same for a list that may serve many scripts: it is a warning there
    GENERAL = 'an item of a list has no effect in this script'


class UnfitName(NamedTuple):
    """A label, a path, a pattern or an outcome in the settings that a machine does not have."""

    error: SettingsError
    name: str
    kind: UnfitKind


# True: such a name is an error. False: it is a warning. A function decides about each one
Strictness = Union[bool, Callable[[UnfitName], None]]


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return ' (did you mean NAME?)' with the closest of these names, or '' where none is close."""
    close = get_close_matches(name, sorted(set(names)), 1)
    return ' (did you mean {}?)'.format(close[0]) if close else ''


_PATTERN = 'LABEL or PATH/LABEL, where * stands for any part of a name and ** for any path'


class PathPattern:
    """A pattern of states.

    Without a '/' it is compared with the label, in whatever container. Else it is compared with the
    path of the state, which may begin with the name of the top machine or below it.
    """

    def __init__(self, text: str) -> None:
        """Read a pattern.

        :raises SettingsError: where it is empty, or a part of it is.
        """
        parts = text.strip('/').split('/') if isinstance(text, str) else ['']
        if not all(parts):
            raise SettingsError('pattern', text, _PATTERN)
        self.text = '/'.join(parts)
        self._parts = tuple(parts)

    def matches(self, path: str, label: str) -> bool:
        """Whether the state `label` of the container at `path` is meant."""
        if len(self._parts) == 1 and self._parts[0] != '**':
            return fnmatch.fnmatchcase(label, self._parts[0])
        whole = tuple(path.split('/')) + (label,)
        return _matches(self._parts, whole) or _matches(self._parts, whole[1:])


def _matches(parts: Sequence[str], names: Tuple[str, ...]) -> bool:
    if not parts:
        return not names
    if parts[0] == '**':
        return _matches(parts[1:], names) or (bool(names) and _matches(parts, names[1:]))
    return (
        bool(names) and fnmatch.fnmatchcase(names[0], parts[0]) and _matches(parts[1:], names[1:])
    )
