"""Opens the database of a store, after a look at whether all of it is there."""

import os
import sqlite3
import threading
import time
import weakref
from typing import Callable, Dict, Tuple
from urllib.parse import quote

from smach_oracle.forking import in_child

from .accepting import prepare, put_in_doubt
from .errors import StoreDamaged, StoreError
from .soundness import ACCEPT, LOG, Content, Files, examined, missed
from .tables import (
    BUSY_S,
    FORMAT,
    MAGIC,
    connect,
    content_of,
    make_store,
    make_tables,
    needs_log,
    try_to_write,
)

# stores that this process has open, by device and inode. Only SQLite looks at their files: where a
# process closes a file, it loses all locks that it has on it (POSIX, fcntl), and another program
# could then take the log away
_open_here: Dict[Tuple[int, int], 'weakref.WeakSet[object]'] = {}
# waits before a store that looks damaged, or whose log goes meanwhile, is looked at again: a
# program that begins or ends changes several files
LOOKS_AGAIN_S = (0.05, 0.2)
_LOCKED_S = 0.02  # wait before the next try to begin a log

_looking = threading.Lock()  # held from the look at the files until the store is noted


def _forget() -> None:
    """Begin as a child process: what is open, and whoever looks, is the parent's."""
    global _looking
    _looking = threading.Lock()
    _open_here.clear()


in_child(_forget)


def note_open(where: str, store: object) -> None:
    """Note that this process has the store at `where` open, as long as `store` lives."""
    _open_here.setdefault(_file_of(where), weakref.WeakSet()).add(store)


def note_closed(store: object) -> None:
    """Note that `store` is closed."""
    for stores in list(_open_here.values()):  # none is removed: another thread may fill it now
        stores.discard(store)


def _file_of(where: str) -> Tuple[int, int]:
    found = os.stat(where)
    return found.st_dev, found.st_ino


def _is_open_here(where: str) -> bool:
    try:
        return bool(_open_here.get(_file_of(where)))
    except OSError:
        return False


def _begin_log(database: sqlite3.Connection) -> None:
    """Have SQLite write a log, once no other program begins or ends its own.

    SQLite waits for locks by itself, but not for this one.
    """
    until_s = time.monotonic() + BUSY_S
    while True:
        try:
            database.execute('PRAGMA journal_mode = WAL')
            return
        except sqlite3.OperationalError as err:
            if 'locked' not in str(err) or time.monotonic() > until_s:
                raise
            time.sleep(_LOCKED_S)


class Opening:
    """The way in which one store is opened."""

    def __init__(
        self, path: str, where: str, read_only: bool, accepts: str, begin: Callable[[Content], None]
    ) -> None:
        """`path`: as the user has named it. `where`: of its own file.

        `accepts`: who takes what is left of a store that has lost some of it, '' for nobody.
        `begin`: takes what it has before its log is begun.
        """
        self.path, self._where, self.read_only = path, where, read_only
        self._accepts, self._begin = accepts, begin
        self.is_damaged = False  # and accepted

    def _look_at_files(self) -> None:
        """Make a new store where there is none. Refuse one that has lost some of it.

        :raises StoreError: for no store.
        :raises StoreDamaged: for one that has lost some of it.
        """
        with _looking:
            try:
                files = self._examined()
            except StoreDamaged:
                if not self._accepts:
                    raise
                prepare(self._where, self.path)
                self.is_damaged = True
                return
            if not files.is_there:
                if self.read_only:
                    raise StoreError('{}: there is no such store'.format(self.path))
                make_store(self._where)
            note_open(self._where, self)  # from before SQLite opens it, for another thread

    def _examined(self) -> Files:
        for waits_s in LOOKS_AGAIN_S:
            try:
                return self._checked()
            except (StoreDamaged, FileNotFoundError):
                time.sleep(waits_s)
        return self._checked()

    def _checked(self) -> Files:
        if _is_open_here(self._where):
            return Files(True)  # it was looked at before
        files = examined(self._where, self.path)
        if files.is_there:
            self._check_content(files)
        return files

    def _check_content(self, files: Files) -> None:
        """Check that a store has what its mark says. This changes nothing, not even its log."""
        if files.mark is None and not files.lacks_log:
            return
        database = None
        try:
            database = connect(
                'file:{}?{}'.format(
                    quote(self._where), 'immutable=1' if files.lacks_log else 'mode=ro'
                )
            )
            content = content_of(database)
            is_lost = files.lacks_log and needs_log(database)
        except sqlite3.OperationalError:
            return  # such as in a folder that cannot be written: who opens it says so
        finally:
            if database is not None:
                database.close()
        if missed(files.mark, content) if files.mark else is_lost:
            raise StoreDamaged(
                '{0}: {1}. Put its files back from a copy. {2}'.format(
                    self.path,
                    'its log, {}{}, is missing, and with it the latest moments'.format(
                        self.path, LOG
                    )
                    if files.lacks_log
                    else 'its latest moments are missing: it or its log was damaged or replaced',
                    ACCEPT.format(self.path),
                )
            )

    def opened(self, synchronous: str) -> sqlite3.Connection:
        """Return its database.

        :raises StoreError: for what is no store, or of a later version.
        :raises StoreDamaged: for one that has lost some of it.
        :raises sqlite3.Error: where SQLite cannot open it.
        """
        self._look_at_files()
        if not self.read_only:
            return self._connected(self._where, synchronous)
        where = quote(self._where)
        try:  # who reads leaves the log to who writes
            return self._connected('file:{}?mode=ro'.format(where), synchronous)
        except sqlite3.OperationalError:
            if os.path.exists(self._where + LOG):
                raise
        # such as on a medium that is read only, where SQLite can write no log
        return self._connected('file:{}?immutable=1'.format(where), synchronous)

    def _connected(self, where: str, synchronous: str) -> sqlite3.Connection:
        database = connect(where)
        try:
            self._check(database)
            if self.read_only:
                database.execute('PRAGMA query_only = ON')
            else:
                make_tables(database)
                if self.is_damaged:
                    put_in_doubt(database, self._accepts)
                self._begin(content_of(database))
                _begin_log(database)
                database.execute('PRAGMA synchronous = ' + synchronous)
                try_to_write(database)
            return database
        except BaseException:
            database.close()
            raise

    def _check(self, database: sqlite3.Connection) -> None:
        (magic,) = database.execute('PRAGMA application_id').fetchone()
        (version,) = database.execute('PRAGMA user_version').fetchone()
        (tables,) = database.execute('SELECT count(*) FROM sqlite_master').fetchone()
        if (tables or self.read_only) and magic != MAGIC:
            raise StoreError('{}: is no store of smach_oracle'.format(self.path))
        if version > FORMAT:
            raise StoreError(
                '{}: has format {}, and this program knows {}'.format(self.path, version, FORMAT)
            )
