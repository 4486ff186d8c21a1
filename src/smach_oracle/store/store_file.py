"""One store: an SQLite database for any number of machines and trials.

Every moment of a trial stays, so that each can be resumed from. Where the trial has gone on from an
earlier one, those between stay, too, and count for nothing that follows. A moment has the facts
that changed with it. What is large is kept once, by its content.
"""
import contextlib
import ctypes
import os
import sqlite3
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple
from urllib.parse import quote

from smach_oracle.forking import in_child

from .errors import StoreDamaged, StoreError, told_error
from .names import RENAMED
from .renaming import Renaming, containers_of, told_renaming
from .rows import LogLine, NewMoment, StoredFact, StoredMoment, StoredTrial, StoredValue

FORMAT = 1
MAGIC = 0x534D4F53  # "SMOS": which program's file it is, where SQLite keeps that
SYNCHRONOUS = ('FULL', 'NORMAL', 'OFF')
LAST = 1 << 62  # behind the number of any moment
BUSY_S = 5.0  # how long one process waits for another that writes
_SCHEMA = '''
CREATE TABLE IF NOT EXISTS structures (id TEXT PRIMARY KEY, description TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS trials (number INTEGER PRIMARY KEY, machine TEXT NOT NULL,
    trial_id TEXT NOT NULL UNIQUE, structure TEXT NOT NULL, begun REAL NOT NULL, ended REAL,
    outcome TEXT NOT NULL DEFAULT '');
CREATE INDEX IF NOT EXISTS trials_of ON trials (machine, number);
CREATE TABLE IF NOT EXISTS moments (number INTEGER PRIMARY KEY, trial INTEGER NOT NULL,
    at REAL NOT NULL, seq INTEGER NOT NULL, kind TEXT NOT NULL, path TEXT NOT NULL,
    label TEXT NOT NULL, after INTEGER);
CREATE INDEX IF NOT EXISTS moments_of ON moments (trial, number);
CREATE TABLE IF NOT EXISTS facts (moment INTEGER NOT NULL, path TEXT NOT NULL, name TEXT NOT NULL,
    text TEXT, whole BLOB);
CREATE INDEX IF NOT EXISTS facts_of ON facts (moment);
CREATE TABLE IF NOT EXISTS parts (digest BLOB PRIMARY KEY, data BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS log (number INTEGER PRIMARY KEY, at REAL NOT NULL, who TEXT NOT NULL,
    what TEXT NOT NULL);
'''


class NewTrial(NamedTuple):
    """A trial about to begin. `structure`: id and description of its machine."""

    machine: str
    trial_id: str
    structure: Tuple[str, str]
    begun: float  # s since the epoch


class StoreFile:
    """An open store. To be used in one thread at a time."""

    def __init__(self, path: str, synchronous: str = 'FULL', read_only: bool = False) -> None:
        """Open the store at `path`, made if it is not there.

        `synchronous`: FULL survives a power cut, NORMAL may lose the last moments by one, OFF by a
        crash of the operating system may be damaged.

        :raises StoreError: where it cannot be opened or written, is no store, or of a later
            version.
        :raises StoreDamaged: where SQLite says so.
        """
        self.path = path
        self.read_only = read_only
        try:
            self._db = self._opened(synchronous)
        except sqlite3.Error as err:
            raise told_error(path, err) from err
        in_child(self._let_go)

    def _let_go(self) -> None:
        # Never close a parent's database, nor let it be freed: SQLite would take it for its own.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._db))

    def _opened(self, synchronous: str) -> sqlite3.Connection:
        where = os.path.abspath(self.path)
        if self.read_only and not os.path.exists(where):
            raise StoreError('{}: there is no such store'.format(self.path))
        try:
            return self._connected(where, synchronous)
        except sqlite3.OperationalError:
            if not self.read_only or os.path.exists(where + '-wal'):
                raise
        # such as on a medium that is read only, where SQLite can write no log
        return self._connected('file:{}?immutable=1'.format(quote(where)), synchronous)

    def _connected(self, where: str, synchronous: str) -> sqlite3.Connection:
        database = sqlite3.connect(where, timeout=BUSY_S, isolation_level=None,
                                   check_same_thread=False, uri=where.startswith('file:'))
        try:
            self._check(database)
            if self.read_only:
                database.execute('PRAGMA query_only = ON')
            else:
                database.execute('PRAGMA journal_mode = WAL')
                database.execute('PRAGMA synchronous = ' + synchronous)
                self._make(database)
                _try_to_write(database)
            return database
        except BaseException:
            database.close()
            raise

    def _check(self, database: sqlite3.Connection) -> None:
        magic, = database.execute('PRAGMA application_id').fetchone()
        version, = database.execute('PRAGMA user_version').fetchone()
        tables, = database.execute('SELECT count(*) FROM sqlite_master').fetchone()
        if (tables or self.read_only) and magic != MAGIC:
            raise StoreError('{}: is no store of smach_oracle'.format(self.path))
        if version > FORMAT:
            raise StoreError('{}: has format {}, and this program knows {}'.format(
                self.path, version, FORMAT))

    def _make(self, database: sqlite3.Connection) -> None:
        tables, = database.execute('SELECT count(*) FROM sqlite_master').fetchone()
        if tables:
            return
        database.execute('BEGIN IMMEDIATE')
        for statement in _SCHEMA.split(';'):
            if statement.strip():
                database.execute(statement)
        database.execute('PRAGMA application_id = {}'.format(MAGIC))
        database.execute('PRAGMA user_version = {}'.format(FORMAT))
        database.execute('COMMIT')

    def close(self) -> None:
        """Close it."""
        self._db.close()

    # -- writing

    def begin_trial(self, trial: NewTrial) -> int:
        """Add a trial, and return its number.

        :raises sqlite3.Error: where it cannot be written.
        """
        with _Transaction(self._db):
            self._db.execute('INSERT OR IGNORE INTO structures VALUES (?, ?)', trial.structure)
            row = self._db.execute(
                'INSERT INTO trials (machine, trial_id, structure, begun) VALUES (?, ?, ?, ?)',
                (trial.machine, trial.trial_id, trial.structure[0], trial.begun))
            return int(row.lastrowid or 0)

    def keep_structure(self, structure: Tuple[str, str]) -> None:
        """Keep the id and the description of a structure that a trial goes on with.

        :raises sqlite3.Error: where it cannot be written.
        """
        with _Transaction(self._db):
            self._db.execute('INSERT OR IGNORE INTO structures VALUES (?, ?)', structure)

    def add(self, trial: int, moments: Sequence[NewMoment]) -> None:
        """Commit moments of a trial, all or none.

        :raises sqlite3.Error: where they cannot be written.
        """
        with _Transaction(self._db):
            self._add(trial, moments)

    def _add(self, trial: int, moments: Sequence[NewMoment]) -> None:
        database = self._db
        for moment in moments:
            number = database.execute(
                'INSERT INTO moments (trial, at, seq, kind, path, label, after) VALUES '
                '(?, ?, ?, ?, ?, ?, ?)', (trial, *moment[:5], moment.after)).lastrowid
            parts: Dict[bytes, bytes] = {}
            rows = []
            for path, name, value in moment.facts:
                text = whole = None
                if value is not None:
                    text, whole, needed = value
                    parts.update(needed)
                rows.append((number, path, name, text, whole))
            if rows:
                database.executemany('INSERT INTO facts VALUES (?, ?, ?, ?, ?)', rows)
            if parts:
                database.executemany('INSERT OR IGNORE INTO parts VALUES (?, ?)',
                                     list(parts.items()))

    def end_trial(self, trial: int, at: float, outcome: str) -> None:
        """Note that a trial has ended, so that it is never resumed.

        :raises sqlite3.Error: where it cannot be written.
        """
        with _Transaction(self._db):
            self._end(trial, at, outcome)

    def edit(self, trial: int, moment: NewMoment, who: str, what: str) -> None:
        """Commit a moment that somebody has made by hand, with a line in the log.

        :raises StoreError: where it cannot be written.
        """
        try:
            with _Transaction(self._db):
                self._log(moment.at, who, what)
                self._add(trial, [moment])
        except sqlite3.Error as err:
            raise told_error(self.path, err) from err

    def drop(self, trial: int, at: float, outcome: str, who: str) -> None:
        """End a trial by hand, so that it is never resumed, with a line in the log.

        :raises StoreError: where it cannot be written.
        """
        try:
            with _Transaction(self._db):
                self._log(at, who, 'trial {}: {}'.format(trial, outcome))
                self._end(trial, at, outcome)
        except sqlite3.Error as err:
            raise told_error(self.path, err) from err

    def _log(self, at: float, who: str, what: str) -> None:
        self._db.execute('INSERT INTO log (at, who, what) VALUES (?, ?, ?)', (at, who, what))

    def _end(self, trial: int, at: float, outcome: str) -> None:
        self._db.execute('UPDATE trials SET ended = ?, outcome = ? WHERE number = ?',
                         (at, outcome, trial))

    # -- reading

    def trials(self, machine: Optional[str] = None) -> List[StoredTrial]:
        """Return the trials, of all machines or one, oldest first.

        :raises StoreDamaged: where it cannot be read.
        """
        chosen, given = ('', ()) if machine is None else ('WHERE machine = ? ', (machine,))
        return [StoredTrial(*row) for row in self._read(
            'SELECT number, machine, trial_id, structure, begun, ended, outcome, '
            '(SELECT count(*) FROM moments WHERE trial = trials.number) '
            'FROM trials {}ORDER BY number'.format(chosen), given)]

    def description(self, structure: str) -> str:
        """Return the description of a machine's structure, '' where it is not known."""
        for text, in self._read('SELECT description FROM structures WHERE id = ?', (structure,)):
            return str(text)
        return ''

    def moments(self, trial: int) -> List[StoredMoment]:
        """Return the moments of a trial, oldest first."""
        return [StoredMoment(*row) for row in self._read(
            'SELECT number, at, seq, kind, path, label, after FROM moments WHERE trial = ? '
            'ORDER BY number', (trial,))]

    def trial_of(self, moment: int) -> Optional[StoredTrial]:
        """Return the trial of a moment, None where there is no such moment."""
        for number, in self._read('SELECT trial FROM moments WHERE number = ?', (moment,)):
            return next(each for each in self.trials() if each.number == number)
        return None

    def facts(self, trial: int, until: Optional[int] = None) -> Iterator[StoredFact]:
        """Yield the facts of a trial in the order in which they were written.

        `until`: the last moment that counts. By default the last one of all. Of those before it
        the ones count that it has followed. A moment without any fact is yielded once, with an
        empty name. All names are those that the states have at the end.

        :raises StoreDamaged: where it cannot be read.
        """
        stretches = self._stretches(trial, LAST if until is None else until)
        renamings = self._renamings(trial, stretches)
        for position, (first, last) in enumerate(stretches):
            for row in self._read(
                    'SELECT moments.number, moments.kind, moments.path, moments.label, facts.path, '
                    'name, text, whole FROM moments LEFT JOIN facts '
                    'ON facts.moment = moments.number WHERE trial = ? '
                    'AND moments.number BETWEEN ? AND ? ORDER BY moments.number, facts.rowid',
                    (trial, first, last)):
                number, kind, path, label, of, name, text, whole = row
                fact = StoredFact(number, kind, path, label, of or '', name or '',
                                  StoredValue(text, whole))
                for behind, renaming in renamings:
                    if (position, number) < behind:
                        fact = renaming(fact)
                yield fact

    def _renamings(self, trial: int, stretches: List[Tuple[int, int]]
                   ) -> List[Tuple[Tuple[int, int], Renaming]]:
        """Return the names of states from certain moments on, oldest first.

        Each moment is the position of its stretch, and its number.
        """
        found = []
        for position, (first, last) in enumerate(stretches):
            for number, machine, text in self._read(
                    'SELECT moment, machine, text FROM facts JOIN moments ON moment = '
                    'moments.number JOIN trials ON trial = trials.number WHERE trial = ? AND '
                    "facts.path = '' AND name = ? AND moment BETWEEN ? AND ? ORDER BY moment",
                    (trial, RENAMED, first, last)):
                structure, names = told_renaming(StoredValue(text, None))
                found.append(((position, number), Renaming(
                    machine, names, containers_of(self.description(structure)))))
        return found

    def _stretches(self, trial: int, until: int) -> List[Tuple[int, int]]:
        """Return the first and last numbers of the moments that lead to `until`, oldest first."""
        found = []
        for number, after in self._read(
                'SELECT number, after FROM moments WHERE trial = ? AND after IS NOT NULL '
                'ORDER BY number DESC', (trial,)):
            if number <= until:
                found.append((number, until))
                until = after
        return [(0, until)] + found[::-1]

    def part(self, digest: bytes) -> bytes:
        """Return bytes by their digest.

        :raises StoreDamaged: where they are not there.
        """
        for data, in self._read('SELECT data FROM parts WHERE digest = ?', (digest,)):
            return bytes(data)
        raise StoreDamaged('{}: the bytes {} are missing'.format(self.path, digest.hex()))

    def log(self) -> List[LogLine]:
        """Return what was changed by hand, oldest first."""
        return [LogLine(*row) for row in self._read('SELECT at, who, what FROM log ORDER BY number',
                                                    ())]

    def compact(self) -> None:
        """Give what is free in the file back to the disk.

        :raises StoreError: where that cannot be done, as another program reads.
        """
        try:
            self._db.execute('VACUUM')
            self._db.execute('PRAGMA wal_checkpoint(TRUNCATE)')
        except sqlite3.Error as err:
            raise told_error(self.path, err) from err

    def integrity(self) -> Iterator[Tuple[Any, ...]]:
        """Yield what SQLite finds wrong, ('ok',) where that is nothing."""
        return self._read('PRAGMA quick_check', ())

    def _read(self, query: str, given: Tuple[object, ...]) -> Iterator[Tuple[Any, ...]]:
        try:
            for row in self._db.execute(query, given):
                yield row  # not `yield from`, which closes the cursor, also of a closed database
        except sqlite3.Error as err:
            raise told_error(self.path, err) from err


def _try_to_write(database: sqlite3.Connection) -> None:
    """Find out whether it can be written. It changes nothing."""
    database.execute('BEGIN IMMEDIATE')
    try:
        database.execute('PRAGMA user_version = {}'.format(FORMAT))
    finally:
        database.execute('ROLLBACK')


@contextlib.contextmanager
def transaction(store: StoreFile, keep: bool = True) -> Iterator[sqlite3.Connection]:
    """Have all that the body does to the database of a store, or nothing where it raises.

    `keep`: False takes it back in any case.

    :raises StoreError: where it cannot be done.
    """
    database = store._db
    try:
        with _Transaction(database):
            yield database
            if not keep:
                raise _TakenBack
    except _TakenBack:
        pass
    except sqlite3.Error as err:
        raise told_error(store.path, err) from err


class _TakenBack(Exception):
    """Never leaves this module."""


class _Transaction:
    """Commits at its end, or takes all back."""

    def __init__(self, database: sqlite3.Connection) -> None:
        self._database = database

    def __enter__(self) -> None:
        self._database.execute('BEGIN IMMEDIATE')

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if error is None:
            try:
                self._database.execute('COMMIT')
                return
            except BaseException:
                self._roll_back()
                raise
        self._roll_back()

    def _roll_back(self) -> None:
        if self._database.in_transaction:
            self._database.execute('ROLLBACK')
