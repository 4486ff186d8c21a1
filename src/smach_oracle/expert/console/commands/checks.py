"""Checks of single arguments of commands. A check takes what came and gives what is meant, or raises ValueError."""
import math
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

Check = Callable[[Any], Any]
_MOST_OUTPUTS = 64
_DEEPEST = 32


class Spec(NamedTuple):
    """A command: the least role that may give it, and its arguments with their checks."""

    role: str
    checks: Dict[str, Check]


class Output(NamedTuple):
    """A value for the userdata, as typed by a person."""

    key: str
    value: Any  # plain data
    type: str  # '' for plain data, else the ROS message type that the value spells out


def text(longest: int, least: int = 0) -> Check:
    """Text of `least` to `longest` characters, without control characters; what is left out is empty.

    :raises ValueError: (the check) for anything else, saying what is allowed.
    """
    def check(value: Any) -> str:
        if value is None and not least:
            return ''
        if not isinstance(value, str) or not least <= len(value) <= longest:
            raise ValueError('{} is not allowed; allowed: text of {} to {} characters'.format(
                shown(value), least, longest))
        if any(ord(character) < 32 and character not in '\n\t' for character in value):
            raise ValueError('control characters are not allowed')
        return value.encode('utf-8', 'replace').decode('utf-8')
    return check


def one_of(allowed: Tuple[str, ...]) -> Check:
    """One of a few words; the check raises ValueError for others, naming those."""
    def check(value: Any) -> str:
        if value not in allowed:
            raise ValueError('{} is not allowed; allowed: {}'.format(shown(value), ', '.join(allowed)))
        return str(value)
    return check


def shown(value: Any) -> str:
    """What came, for a refusal: never long."""
    said = repr(value)
    return said if len(said) <= 60 else said[:60] + '…'


def outputs(value: Any) -> List[Output]:
    """Values for the userdata; what is left out is none.

    :raises ValueError: for what is no list of outputs, too many of them, one twice, or one that is nested too deep.
    """
    if value is None:
        return []
    if not isinstance(value, list) or len(value) > _MOST_OUTPUTS:
        raise ValueError('"outputs" is a list of at most {} values'.format(_MOST_OUTPUTS))
    found = [_output(each) for each in value]
    if len({output.key for output in found}) < len(found):
        raise ValueError('an output comes twice')
    return found


def _output(value: Any) -> Output:
    if not isinstance(value, dict) or not {'key', 'value'} <= set(value) <= {'key', 'value', 'type'}:
        raise ValueError('an output is {"key": ..., "value": ..., "type": ...}')
    _check_depth(value['value'])
    return Output(text(200, 1)(value['key']), value['value'], text(200)(value.get('type')))


def _check_depth(value: Any) -> None:
    waiting = [(value, 0)]
    while waiting:
        item, depth = waiting.pop()
        if depth > _DEEPEST:
            raise ValueError('an output is nested deeper than {}'.format(_DEEPEST))
        if isinstance(item, float) and not math.isfinite(item):
            raise ValueError('an output holds a number that is too large')
        children = item.values() if isinstance(item, dict) else item if isinstance(item, list) else ()
        waiting += [(child, depth + 1) for child in children]


QUESTION = {'question': text(1000, 1)}
