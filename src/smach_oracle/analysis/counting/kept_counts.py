"""What was counted in bags, kept in the user's cache folder for the next time.

The key of a bag is its file: device, number, size, and the times at which its content and the file
itself were last changed. No program sets the last one, so that another content is another bag,
whatever its name and its date. The key has the version of this package, and the rule, in it. The
file of kept counts may be deleted at any time. Where it cannot be used, nothing is kept.
"""

import hashlib
import os
import sqlite3
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Dict, Iterator, Mapping, Optional, Sequence, Tuple

from smach_oracle.oracle.settings.failure_rule import FailureRule
from smach_oracle.user_cache import cache_folder

from .summary_text import SummaryText

FILE = 'counts.sqlite'
KEPT_DAYS = 90
_SETTLED_NS = 2 * 10**9  # a file that was changed just now may change again within the same tick
_TABLES = ('counts', 'shared')  # of bags by key, and what these share by name
_BUSY_S = 0.5  # another count may be writing
_DAY_S = 86400
_PACKAGE = Path(__file__).resolve().parents[2]
# the part of the package that counts
_COUNTS = ('analysis', 'oracle', 'bag_format.py', 'trial_counter.py')


class KeptCounts:
    """The texts that are kept, by key. A fault of the file ends its use, and is not told."""

    def __init__(self, rule: Optional[FailureRule]) -> None:
        """`rule`: by which the trials are counted. None: that of each record."""
        told = '{} {!r}'.format(_version(), rule)
        self._counted_by = hashlib.blake2b(told.encode(), digest_size=16).digest()
        self._today = int(time.time() // _DAY_S)
        self._path = cache_folder() / FILE
        self._open: Optional[sqlite3.Connection] = None
        with self._usable():
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            # a transaction begins at the first text that is new
            self._open = sqlite3.connect(str(self._path), timeout=_BUSY_S)
            for table in _TABLES:
                self._open.execute(
                    'CREATE TABLE IF NOT EXISTS {} '
                    '(key BLOB PRIMARY KEY, day INTEGER, text TEXT) WITHOUT ROWID'.format(table)
                )

    def key_of(self, path: str) -> Optional[bytes]:
        """Return the key of a bag, None where its file is not there, or was changed just now."""
        try:
            file = os.stat(path)
        except OSError:
            return None
        if abs(time.time_ns() - file.st_mtime_ns) < _SETTLED_NS:
            return None
        # the bags of a folder have neighbouring numbers mostly, and so are neighbours where they
        # are kept, which is quick to read
        return b'%d %d %d %d %d %b' % (
            file.st_dev,
            file.st_ino,
            file.st_size,
            file.st_mtime_ns,
            file.st_ctime_ns,
            self._counted_by,
        )

    def texts(self, keys: Sequence[bytes]) -> Dict[bytes, str]:
        """Return what is kept under some keys, by key."""
        found: Dict[bytes, str] = {}
        with self._usable():
            if self._open is not None:
                asked = 'SELECT key, text FROM counts WHERE key IN ({})'
                marks = ','.join('?' * len(keys))
                found.update(self._open.execute(asked.format(marks), keys))
        return found

    def shared(self, name: str) -> str:
        """Return a text that others name.

        :raises LookupError: where it is not kept.
        """
        with self._usable():
            if self._open is not None:
                asked = 'SELECT text FROM shared WHERE key = ?'
                for (text,) in self._open.execute(asked, (name,)):
                    return str(text)
        raise LookupError(name)

    def keep(self, texts: Mapping[bytes, SummaryText]) -> None:
        """Keep some texts by their keys, once it is closed."""
        shared = {part for text in texts.values() for part in text.shared}
        with self._usable():
            if self._open is not None and texts:
                of_bags = [(key, self._today, each.text) for key, each in texts.items()]
                self._open.executemany('INSERT OR REPLACE INTO counts VALUES (?, ?, ?)', of_bags)
                named = [(part.name, self._today, part.text) for part in shared]
                self._open.executemany('INSERT OR REPLACE INTO shared VALUES (?, ?, ?)', named)

    def close(self) -> None:
        """Write what is new. What is old goes then."""
        with self._usable():
            if self._open is not None:
                if self._open.in_transaction:
                    last_day = self._today - KEPT_DAYS
                    for table in _TABLES:
                        gone = 'DELETE FROM {} WHERE day < ?'.format(table)
                        self._open.execute(gone, (last_day,))
                self._open.commit()
                self._open.close()

    @contextmanager
    def _usable(self) -> Iterator[None]:
        """Do without the file from its first fault on. A damaged one is deleted."""
        try:
            yield
        except (OSError, sqlite3.OperationalError):  # locked, not to be written, a full disk
            self._open = None
        except sqlite3.DatabaseError:
            self._open = None
            with suppress(OSError):
                self._path.unlink()


def _version() -> str:
    """Return a digest of the names, sizes and times of change of the files that count."""
    with os.scandir(str(_PACKAGE)) as entries:
        told = sorted(
            (entry.path, stat.st_size, stat.st_mtime_ns)
            for part in entries
            if part.name in _COUNTS
            for entry, stat in _sources(part)
        )
    return hashlib.blake2b(repr(told).encode(), digest_size=16).hexdigest()


def _sources(entry: 'os.DirEntry[str]') -> Iterator[Tuple['os.DirEntry[str]', os.stat_result]]:
    """Yield the Python files of a folder and below, or a file itself."""
    if entry.is_dir():
        with os.scandir(entry.path) as entries:
            for each in entries:
                yield from _sources(each)
    elif entry.name.endswith('.py'):
        yield entry, entry.stat()
