"""Names in the settings that stand for nothing, who decides about them, and what is meant. Pure."""

from difflib import get_close_matches
from enum import Enum
from typing import Callable, Iterable, NamedTuple, Union

from ..errors import SettingsError


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
    kind: UnfitKind = UnfitKind.NAME


# True: such a name is an error. False: it is a warning. A function decides about each one
Strictness = Union[bool, Callable[[UnfitName], None]]


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return ' (did you mean NAME?)' with the closest of these names, or '' where none is close."""
    close = get_close_matches(name, sorted(set(names)), 1)
    return ' (did you mean {}?)'.format(close[0]) if close else ''
