"""Files and folders as people name them in settings, parameters and command lines. Pure."""

import os

from ..errors import SettingsError


def path_of(text: str) -> str:
    """Return the path with `~` or `~user` at its beginning filled in.

    A relative path is relative to the folder in which the process runs.
    """
    return os.path.expanduser(text)


def can_be_path(text: str) -> bool:
    """Whether the system can be asked for a file of this name."""
    try:
        return b'\0' not in os.fsencode(text)
    except UnicodeEncodeError:
        return False


def check_writable(key: str, path: str, replaced: bool = False) -> None:
    """Find out before it is needed whether a file can be written.

    :param replaced: whether a file next to it is to take its place: then its folder is written in
        any case.
    :raises SettingsError: naming the key, the path and what is wrong with it.
    """
    why = why_not_writable(path, replaced)
    if why:
        raise SettingsError(key, path, 'a file that can be written ({})'.format(why))


def why_not_writable(path: str, replaced: bool = False) -> str:
    """Return why a file cannot be written, '' where it can. See `check_writable`."""
    folder = os.path.dirname(os.path.abspath(path))
    if os.path.isdir(path):
        return 'it is a folder'
    if not os.path.isdir(folder):
        return 'there is no folder {}'.format(folder)
    if os.path.exists(path) and not os.access(path, os.W_OK):
        return 'it is not for this user to write'
    if (replaced or not os.path.exists(path)) and not os.access(folder, os.W_OK | os.X_OK):
        return 'the folder {} is not for this user to write in'.format(folder)
    return ''
