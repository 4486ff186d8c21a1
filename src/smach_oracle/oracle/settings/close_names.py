"""Suggests the name that a mistyped one may stand for. Pure."""

from difflib import get_close_matches
from typing import Iterable


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return ' (did you mean NAME?)' with the closest of these names, or '' where none is close."""
    close = get_close_matches(name, sorted(set(names)), 1)
    return ' (did you mean {}?)'.format(close[0]) if close else ''
