"""The errors of a store."""

import os
import sqlite3


class StoreError(Exception):
    """A store cannot be opened, read or written. The text says which and why."""


class StoreDamaged(StoreError):
    """A store whose content cannot be read."""


def told_error(path: str, err: sqlite3.Error) -> StoreError:
    """Return what SQLite says of the store at `path`, as an error that names it."""
    if isinstance(err, sqlite3.OperationalError):
        return StoreError('{}: {}{}'.format(path, err, _why_not_opened(path, str(err))))
    return StoreDamaged('{}: is damaged, or no store: {}'.format(path, err))


def _why_not_opened(path: str, said: str) -> str:
    """Return what SQLite does not say of a file that it cannot open, '' where that is not known."""
    where = os.path.realpath(path)
    if not said.startswith('unable to open') or not os.path.isfile(where):
        return ''
    if os.access(os.path.dirname(where), os.W_OK):
        return ''
    if os.path.exists(where + '-wal'):
        return '; nothing can be written there, so copy it with {}-wal to another folder'.format(
            os.path.basename(where)
        )
    return '; nothing can be written there'
