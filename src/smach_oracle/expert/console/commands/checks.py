"""Checks of single arguments of commands.

A check takes an argument as it came, and returns its value.

:raises ValueError: (each check) for anything else. The text says what is allowed.
"""

import math
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks

Check = Callable[[object], Any]
_MOST_OUTPUTS = 64
_DEEPEST = 32


class CommandSpec(NamedTuple):
    """A command: the least role that may give it, and its arguments with their checks."""

    role: str
    checks: Dict[str, Check]


class TypedOutput(NamedTuple):
    """A value for the userdata, as typed by a person."""

    key: str
    value: Any  # plain data
    type: str  # '' for plain data, else the ROS message type that the value spells out


def text(longest: int, least: int = 0) -> Check:
    """Return a check that admits text of `least` to `longest` characters.

    Control characters are refused. An argument that is left out is read as the empty text, if that
    is allowed.
    """

    def check(value: object) -> str:
        if value is None and not least:
            return ''
        if not isinstance(value, str) or not least <= len(value) <= longest:
            raise ValueError(
                '{} is not allowed; allowed: text of {} to {} characters'.format(
                    shown(value), least, longest
                )
            )
        if any(ord(character) < 32 and character not in '\n\t' for character in value):
            raise ValueError('control characters are not allowed')
        return value.encode('utf-8', 'replace').decode('utf-8')

    return check


def texts(most: int, longest: int) -> Check:
    """Return a check that admits a list of at most `most` texts, none of them empty."""
    one = text(longest, 1)

    def check(value: object) -> List[str]:
        if not isinstance(value, list) or len(value) > most:
            raise ValueError(
                '{} is not allowed; allowed: a list of at most {} texts'.format(shown(value), most)
            )
        return [one(each) for each in value]

    return check


def one_of(allowed: Tuple[str, ...]) -> Check:
    """Return a check that admits a few words."""
    return _argument(checks.choice(allowed))


def number(low: float, high: float, allowed: str = '') -> Check:
    """Return a check that admits a finite number from `low` to `high`. A refusal says `allowed`."""
    return _argument(
        checks.number(low, high, allowed or 'a number from {:g} to {:g}'.format(low, high))
    )


def whole(low: int, high: int, allowed: str) -> Check:
    """Return a check that admits a whole number from `low` to `high`. A refusal says `allowed`."""
    return _argument(checks.whole(low, allowed, high))


def _argument(check: checks.Check) -> Check:
    """Return a check of arguments made of one of settings. A refusal shows a part of the value."""

    def checked(value: object) -> Any:
        try:
            return check('', value)
        except SettingsError as err:
            raise ValueError(
                '{} is not allowed; allowed: {}'.format(shown(value), err.allowed)
            ) from err

    return checked


flag = _argument(checks.flag)


def optional(check: Check) -> Check:
    """Return a check that admits None in addition to what another one admits."""
    return lambda value: None if value is None else check(value)


# the newest beat that the page had seen, s by the console's clock
seen = optional(number(0.0, 1e12))


def shown(value: object) -> str:
    """Return a value as a short text, for a refusal."""
    whole_text = repr(value)
    return whole_text if len(whole_text) <= 60 else whole_text[:60] + '…'


def outputs(value: object) -> List[TypedOutput]:
    """Return values for the userdata, [] where they are left out.

    :raises ValueError: for what is no list of outputs, too many of them, one twice, or one that is
        nested too deep.
    """
    if value is None:
        return []
    if not isinstance(value, list) or len(value) > _MOST_OUTPUTS:
        raise ValueError('"outputs" is a list of at most {} values'.format(_MOST_OUTPUTS))
    found = [_output(each) for each in value]
    if len({output.key for output in found}) < len(found):
        raise ValueError('an output comes twice')
    return found


def _output(value: object) -> TypedOutput:
    if not isinstance(value, dict) or not {'key', 'value'} <= set(value) <= {
        'key',
        'value',
        'type',
    }:
        raise ValueError('an output is {"key": ..., "value": ..., "type": ...}')
    _check_depth(value['value'])
    return TypedOutput(text(200, 1)(value['key']), value['value'], text(200)(value.get('type')))


def _check_depth(value: object) -> None:
    waiting = [(value, 0)]
    while waiting:
        item, depth = waiting.pop()
        if depth > _DEEPEST:
            raise ValueError('an output is nested deeper than {}'.format(_DEEPEST))
        if isinstance(item, float) and not math.isfinite(item):
            raise ValueError('an output holds a number that is too large')
        children = (
            item.values() if isinstance(item, dict) else item if isinstance(item, list) else ()
        )
        waiting += [(child, depth + 1) for child in children]


QUESTION = {'question': text(1000, 1)}
