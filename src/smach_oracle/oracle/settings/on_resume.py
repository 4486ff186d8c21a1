"""The settings on_resume and resume_map: how a stored trial goes on that was not finished. Pure."""

from typing import Dict, Iterator, Mapping, Tuple

from ..errors import SettingsError
from .checks import no_name
from .written import as_text

ASK, RECOVER, RESTART, STATE = 'ask', 'recover', 'restart', 'state'
_MAP = 'a mapping of labels, or of paths of states, to those of now, such as KITCHEN/LOOK: SEARCH'
_ALLOWED = 'ask, recover, restart or state:LABEL'


def checked_on_resume(key: str, value: object) -> Tuple[str, str]:
    """Check for what may be done, and return it, and the path of a state where it names one.

    :raises SettingsError: for anything else.
    """
    if isinstance(value, str):
        word, colon, path = value.partition(':')
        if word == STATE and path.strip():
            return STATE, path.strip()
        if word in (ASK, RECOVER, RESTART) and not colon:
            return word, ''
    raise SettingsError(key, value, _ALLOWED)


def checked_resume_map(key: str, value: object) -> Dict[str, str]:
    """Check for paths of states by those that they had in an earlier script, and return them.

    The parameter server makes mappings in mappings of paths. They are put together again.

    :raises SettingsError: for anything else.
    """
    return dict(_paths(key, value, ''))


def _paths(key: str, value: object, before: str) -> Iterator[Tuple[str, str]]:
    if not isinstance(value, Mapping):
        raise SettingsError(key, value, _MAP)
    for old, new in value.items():
        if not isinstance(old, str) or not _is_path(old):
            raise no_name(key, old, _MAP)
        new = as_text(new)
        if isinstance(new, Mapping):
            yield from _paths(key, new, before + old + '/')
        elif isinstance(new, str) and _is_path(new):
            yield before + old, new
        else:
            raise no_name('{}.{}{}'.format(key, before, old), new, _MAP)


def _is_path(text: str) -> bool:
    return all(part.strip() for part in text.split('/'))
