"""Checks of single arguments of commands. A check takes what came and gives what is meant, or raises ValueError."""
from typing import Any, Callable, Dict, NamedTuple, Tuple

Check = Callable[[Any], Any]


class Spec(NamedTuple):
    """A command: the least role that may give it, and its arguments with their checks."""

    role: str
    checks: Dict[str, Check]


def text(longest: int, least: int = 0) -> Check:
    """Text of `least` to `longest` characters, without control characters; what is left out is empty."""
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
    """One of a few words."""
    def check(value: Any) -> str:
        if value not in allowed:
            raise ValueError('{} is not allowed; allowed: {}'.format(shown(value), ', '.join(allowed)))
        return str(value)
    return check


def shown(value: Any) -> str:
    """What came, for a refusal: never long."""
    said = repr(value)
    return said if len(said) <= 60 else said[:60] + '…'


QUESTION = {'question': text(1000, 1)}
