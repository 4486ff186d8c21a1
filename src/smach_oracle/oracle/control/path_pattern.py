"""Patterns of states: LABEL or PATH/LABEL, with * for a part of a name and ** for any path."""

import fnmatch
from typing import Sequence, Tuple

from ..errors import SettingsError

_ALLOWED = 'LABEL or PATH/LABEL, where * stands for any part of a name and ** for any path'


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
            raise SettingsError('pattern', text, _ALLOWED)
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
        return any(_matches(parts[1:], names[skipped:]) for skipped in range(len(names) + 1))
    return (
        bool(names) and fnmatch.fnmatchcase(names[0], parts[0]) and _matches(parts[1:], names[1:])
    )
