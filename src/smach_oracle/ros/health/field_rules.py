"""The rules by which a message, or a status of diagnostics, says that the robot is well. Pure."""

from typing import Any, NamedTuple

from smach_oracle.oracle.number_checks import is_number
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.settings.health import HealthCondition

# diagnostic_msgs/DiagnosticStatus
LEVELS = ('ok', 'warn', 'error', 'stale')
LONGEST = 200  # letters of a value that are told


class _NoField(Exception):
    """A message has no such field. It never leaves this module."""


class Status(NamedTuple):
    """A status of the diagnostics."""

    level: int
    message: str


def why_unwell_by_message(condition: HealthCondition, message: Any) -> str:
    """Return what is wrong by a message of the condition's topic, '' where all is well."""
    try:
        value = _field(message, condition.field)
    except _NoField:
        return '{} has no field {}'.format(condition.source, condition.field)
    if condition.equals is not None:
        return '' if value == condition.equals else _in_words(value)
    if not is_number(value):
        return '{} is no number'.format(shortened(repr(value), LONGEST))
    if condition.at_least <= value <= condition.at_most:
        return ''
    return (
        '{:g}, at least {:g}'.format(value, condition.at_least)
        if value < condition.at_least
        else '{:g}, at most {:g}'.format(value, condition.at_most)
    )


def _field(message: Any, path: str) -> Any:
    """The field of a dotted name. A number in it is a place in a list.

    :raises _NoField: where there is none.
    """
    found = message
    for name in path.split('.'):
        try:
            found = found[int(name)] if name.isdecimal() else getattr(found, name)
        except (AttributeError, IndexError, TypeError, ValueError) as err:
            raise _NoField(path) from err
    return found


def _in_words(value: object) -> str:
    if isinstance(value, bool):
        return 'on' if value else 'off'
    return shortened(str(value), LONGEST) or 'empty'


def why_unwell_by_status(condition: HealthCondition, status: Status) -> str:
    """Return what is wrong by a status of the diagnostics, '' where all is well."""
    if 0 <= status.level <= LEVELS.index(condition.worst):
        return ''
    level = LEVELS[status.level] if 0 <= status.level < len(LEVELS) else str(status.level)
    return '{} ({})'.format(level, status.message) if status.message else level
