"""One store: an SQLite database for any number of machines and trials.

Every moment of a trial can be resumed from. The older ones of a long trial are thinned. Where the
trial has gone on from an earlier one, those between stay, too, and count for nothing that follows.
A moment has the facts that changed with it. What is large is kept once, by its content.
"""

import contextlib
import ctypes
import os
import sqlite3
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.forking import in_child

from .errors import StoreDamaged, StoreError, told_error
from .names import RENAMED
from .opening import Opening, note_closed, note_open
from .renaming import Renaming, containers_of, told_renaming
from .rows import LogLine, NewMoment, StoredFact, StoredMoment, StoredTrial, StoredValue
from .soundness import CLOSED, Content, Mark
from .tables import content_of

SYNCHRONOUS = ('FULL', 'NORMAL', 'OFF')
LAST = 1 << 62  # behind the number of any moment


class NewTrial(NamedTuple):
    """A trial about to begin. `structure`: id and description of its machine."""

    machine: str
    trial_id: str
    structure: Tuple[str, str]
    begun: float  # s since the epoch


class StoreFile:
    """An open store. To be used in one thread at a time."""

    def __init__(
        self, path: str, synchronous: str = 'FULL', read_only: bool = False, accept_by: str = ''
    ) -> None:
        """Open the store at `path`, made if there is nothing of one.

        `synchronous`: FULL survives a power cut, NORMAL may lose the last moments by one, OFF by a
        crash of the operating system may be damaged. `accept_by`: who has what can be read
        of a store taken that has lost some of it.

        :raises StoreError: where it cannot be opened or written, is no store, or of a later
            version.
        :raises StoreDamaged: where SQLite says so, and where some of it is missing.
        """
        self.path = path
        self.read_only = read_only
        where = os.path.realpath(path)
        self._mark = Mark(where, synchronous)
        self._has = Content()
        self.added_parts: Dict[bytes, int] = {}  # new in the store, with the moment of each
        self._version = 0  # changes as another program changes the store
        try:
            opening = Opening(path, where, read_only, accept_by, self._begin)
            self._db = opening.opened(synchronous)
            note_open(where, self)
        except sqlite3.Error as err:
            raise told_error(path, err) from err
        except OSError as err:
            raise StoreError('{}: cannot be used: {}'.format(path, err)) from err
        self.was_damaged = opening.is_damaged
        in_child(self._let_go)

    def _let_go(self) -> None:
        # Never close a parent's database, nor let it be freed: SQLite would take it for its own.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._db))

    def _begin(self, content: Content) -> None:
        self._has = content
        self._mark.write(content, log='')

    def close(self) -> None:
        """Close it. Where nobody else has it open, no log stays behind, and its file says so."""
        if not self.read_only:
            with contextlib.suppress(sqlite3.Error):
                self._db.execute('PRAGMA busy_timeout = 0')
                (mode,) = self._db.execute('PRAGMA journal_mode = DELETE').fetchone()
                if mode == 'delete':
                    self._note(log=CLOSED)
        self._mark.close()
        self._db.close()
        note_closed(self)

    def _note(self, log: Optional[str] = None, **changed: int) -> None:
        """Mark what it has. Where another program has changed it, trials may have gone."""
        with contextlib.suppress(sqlite3.Error):  # what was committed is there all the same
            (version,) = self._db.execute('PRAGMA data_version').fetchone()
            self._has = (
                self._has._replace(**changed) if version == self._version else content_of(self._db)
            )
            self._version = version
            self._mark.write(self._has, log)

    # -- writing

    def begin_trial(self, trial: NewTrial) -> int:
        """Add a trial, and return its number.

        :raises sqlite3.Error: where it cannot be written.
        """
        with _Transaction(self._db):
            self._db.execute('INSERT OR IGNORE INTO structures VALUES (?, ?)', trial.structure)
            row = self._db.execute(
                'INSERT INTO trials (number, machine, trial_id, structure, begun) VALUES '
                '((SELECT max(coalesce(max(number), 0), ?) + 1 FROM trials), ?, ?, ?, ?)',
                (
                    self.lost_until() or 0,
                    trial.machine,
                    trial.trial_id,
                    trial.structure[0],
                    trial.begun,
                ),
            )
        number = int(row.lastrowid or 0)
        self._note(trial=number)
        return number

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
            number = self._add(trial, moments)
        self._note(moment=number)

    def _add(self, trial: int, moments: Sequence[NewMoment]) -> int:
        """Add moments of a trial, and return the number of the last one."""
        database = self._db
        number: Optional[int] = None
        for moment in moments:
            number = database.execute(
                'INSERT INTO moments (trial, at, seq, kind, path, label, after) VALUES '
                '(?, ?, ?, ?, ?, ?, ?)',
                (trial, *moment[:5], moment.after),
            ).lastrowid
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
            for part in parts.items():
                if database.execute('INSERT OR IGNORE INTO parts VALUES (?, ?)', part).rowcount:
                    self.added_parts[part[0]] = number or 0
        return self._has.moment if number is None else number

    def end_trial(self, trial: int, at: float, outcome: str) -> None:
        """Note that a trial has ended, so that it is never resumed.

        :raises sqlite3.Error: where it cannot be written.
        """
        with _Transaction(self._db):
            self._end(trial, at, outcome)
        self._note(ended=self._has.ended + 1)

    def edit(self, trial: int, moment: NewMoment, who: str, what: str) -> None:
        """Commit a moment that somebody has made by hand, with a line in the log.

        :raises StoreError: where it cannot be written.
        """
        try:
            with _Transaction(self._db):
                self._log(moment.at, who, what)
                number = self._add(trial, [moment])
            self._note(moment=number)
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
            self._note(ended=self._has.ended + 1)
        except sqlite3.Error as err:
            raise told_error(self.path, err) from err

    def _log(self, at: float, who: str, what: str) -> None:
        self._db.execute('INSERT INTO log (at, who, what) VALUES (?, ?, ?)', (at, who, what))

    def _end(self, trial: int, at: float, outcome: str) -> None:
        self._db.execute(
            'UPDATE trials SET ended = ?, outcome = ? WHERE number = ?', (at, outcome, trial)
        )

    # -- reading

    def trials(self, machine: Optional[str] = None) -> List[StoredTrial]:
        """Return the trials, of all machines or one, oldest first.

        :raises StoreDamaged: where it cannot be read.
        """
        if machine is None:
            return list(self._trials('ORDER BY number'))
        return list(self._trials('WHERE machine = ? ORDER BY number', machine))

    def latest_trial(self, machine: str) -> Optional[StoredTrial]:
        """Return the latest trial of a machine, None where it has none. It may have thousands.

        :raises StoreDamaged: where it cannot be read.
        """
        latest = 'WHERE machine = ? ORDER BY number DESC LIMIT 1'
        return next(self._trials(latest, machine), None)

    def _trials(self, which: str, *given: object) -> Iterator[StoredTrial]:
        for row in self._read(
            'SELECT number, machine, trial_id, structure, begun, ended, outcome, '
            '(SELECT count(*) FROM moments WHERE trial = trials.number) FROM trials ' + which,
            given,
        ):
            yield StoredTrial(*row)

    def lost_until(self) -> Optional[int]:
        """Return the number of the trial behind which others may be lost. None: none is lost.

        :raises StoreDamaged: where it cannot be read.
        """
        return next(since for (since,) in self._read('SELECT max(since) FROM marked', ()))

    def description(self, structure: str) -> str:
        """Return the description of a machine's structure, '' where it is not known."""
        for (text,) in self._read('SELECT description FROM structures WHERE id = ?', (structure,)):
            return str(text)
        return ''

    def moments(self, trial: int) -> List[StoredMoment]:
        """Return the moments of a trial, oldest first."""
        return [
            StoredMoment(*row)
            for row in self._read(
                'SELECT number, at, seq, kind, path, label, after FROM moments WHERE trial = ? '
                'ORDER BY number',
                (trial,),
            )
        ]

    def trial_of(self, moment: int) -> Optional[StoredTrial]:
        """Return the trial of a moment, None where there is no such moment."""
        for (number,) in self._read('SELECT trial FROM moments WHERE number = ?', (moment,)):
            return next(self._trials('WHERE number = ?', number))
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
                (trial, first, last),
            ):
                number, kind, path, label, of, name, text, whole = row
                fact = StoredFact(
                    number, kind, path, label, of or '', name or '', StoredValue(text, whole)
                )
                for behind, renaming in renamings:
                    if (position, number) < behind:
                        fact = renaming(fact)
                yield fact

    def _renamings(
        self, trial: int, stretches: List[Tuple[int, int]]
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
                (trial, RENAMED, first, last),
            ):
                structure, names = told_renaming(StoredValue(text, None))
                found.append(
                    (
                        (position, number),
                        Renaming(machine, names, containers_of(self.description(structure))),
                    )
                )
        return found

    def _stretches(self, trial: int, until: int) -> List[Tuple[int, int]]:
        """Return the first and last numbers of the moments that lead to `until`, oldest first."""
        found = []
        for number, after in self._read(
            'SELECT number, after FROM moments WHERE trial = ? AND after IS NOT NULL '
            'ORDER BY number DESC',
            (trial,),
        ):
            if number <= until:
                found.append((number, until))
                until = after
        return [(0, until)] + found[::-1]

    def part(self, digest: bytes) -> bytes:
        """Return bytes by their digest.

        :raises StoreDamaged: where they are not there.
        """
        for (data,) in self._read('SELECT data FROM parts WHERE digest = ?', (digest,)):
            return bytes(data)
        raise StoreDamaged('{}: the bytes {} are missing'.format(self.path, digest.hex()))

    def log(self) -> List[LogLine]:
        """Return what was changed by hand, oldest first."""
        return [
            LogLine(*row) for row in self._read('SELECT at, who, what FROM log ORDER BY number', ())
        ]

    def compact(self) -> None:
        """Give what is free in the file back to the disk.

        :raises StoreError: where that cannot be done, as another program reads.
        """
        try:
            self._note(**content_of(self._db)._asdict())  # once more: others may have had more
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
            store._note(**content_of(database)._asdict())  # before trials are gone
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
