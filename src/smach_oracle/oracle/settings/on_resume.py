"""The setting on_resume: what is done about a stored trial that was not finished. Pure."""
from typing import Tuple

from ..errors import SettingsError

ASK, RECOVER, RESTART, STATE = 'ask', 'recover', 'restart', 'state'
_ALLOWED = 'ask, recover, restart or state:LABEL'


def checked_on_resume(key: str, value: object) -> Tuple[str, str]:
    """Check for what may be done; return it, and the path of a state where it names one.

    :raises SettingsError: for anything else.
    """
    if isinstance(value, str):
        word, colon, path = value.partition(':')
        if word == STATE and path.strip():
            return STATE, path.strip()
        if word in (ASK, RECOVER, RESTART) and not colon:
            return word, ''
    raise SettingsError(key, value, _ALLOWED)
