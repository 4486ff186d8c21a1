"""The trials that go from a store: those that have ended, the oldest first."""

import json
import re
import sqlite3
from typing import Dict, Iterable, List, NamedTuple, Set

from .errors import StoreError
from .holding import MachineLock
from .names import RENAMED, STRUCTURE
from .renaming import told_renaming
from .rows import StoredTrial, StoredValue
from .store_file import StoreFile, transaction

TELLS_IT = 'it tells that a person was asked after `oracle_state accept`'
_PART = re.compile(r'"\$part":"([0-9a-f]+)"')


class Dropped(NamedTuple):
    """A trial that goes, or stays although the limits are over it, and why."""

    trial: StoredTrial
    why: str


class Retention:
    """The trials of one store that stay and go. Nothing is changed before `drop`."""

    def __init__(self, store: StoreFile, days: float = 0.0, size: float = 0.0) -> None:
        """`days`: since a trial ended. `size`: bytes of the store. 0: no limit."""
        self._store, self._days, self._size = store, days, size
        self.going: List[Dropped] = []
        self.kept: List[Dropped] = []

    def plan(self, now: float) -> None:
        """Choose what goes. `now`: s since the epoch.

        :raises StoreError: where the store cannot be read, or another program writes all the time.
        """
        trials = sorted(self._store.trials(), key=lambda trial: trial.ended or trial.begun)
        asked = self._asked(trials)
        with transaction(self._store, keep=False) as database:
            for trial in trials:
                why = self._why(database, trial, now)
                if not why:
                    continue
                stays = TELLS_IT if trial.number in asked else self._why_kept(trial)
                (self.kept if stays else self.going).append(Dropped(trial, stays or why))
                if not stays and self._size:
                    _take_out(database, [trial.number])

    def _asked(self, trials: Iterable[StoredTrial]) -> Set[int]:
        """Return the latest trial of each machine since trials may have been lost.

        Without it the machine would ask a person once more.
        """
        lost = self._store.lost_until()
        latest: Dict[str, int] = {}
        for trial in trials:
            if lost is not None and trial.number > lost:
                latest[trial.machine] = max(trial.number, latest.get(trial.machine, 0))
        return set(latest.values())

    def _why(self, database: sqlite3.Connection, trial: StoredTrial, now: float) -> str:
        age = (now - (trial.ended or trial.begun)) / 86400.0
        if self._days and age > self._days:
            return '{:.1f} days old'.format(age)
        if self._size and size_of(database) > self._size:
            return 'the oldest of {:.3f} GB'.format(size_of(database) / 1e9)
        return ''

    def _why_kept(self, trial: StoredTrial) -> str:
        if trial.ended is None:
            return 'it has not ended'
        if MachineLock(self._store.path, trial.machine).is_held_elsewhere():
            return 'a program holds machine ' + trial.machine
        return ''

    def drop(self) -> None:
        """Take out what goes, and what nothing refers to any more. Compact the file.

        A machine that a program holds by now keeps its trials.

        :raises StoreError: where the store cannot be written.
        """
        locks = []
        try:
            numbers = []
            for machine in sorted({each.trial.machine for each in self.going}):
                lock = MachineLock(self._store.path, machine)
                lock.take()
                locks.append(lock)
                numbers += [
                    each.trial.number for each in self.going if each.trial.machine == machine
                ]
            with transaction(self._store) as database:
                _take_out(database, numbers)
        finally:
            for lock in locks:
                lock.release()
        self._store.compact()


def size_of(database: sqlite3.Connection) -> int:
    """Return the bytes of a store that are in use."""
    pages, free, size = (
        database.execute('PRAGMA ' + name).fetchone()[0]
        for name in ('page_count', 'freelist_count', 'page_size')
    )
    return int((pages - free) * size)


def _take_out(database: sqlite3.Connection, trials: Iterable[int]) -> None:
    structures = set()
    for number in trials:  # each has ended: see `_why_kept`
        structures.update(_structures(database, number))
        database.execute(
            'DELETE FROM facts WHERE moment IN (SELECT number FROM moments WHERE trial = ?)',
            (number,),
        )
        database.execute('DELETE FROM moments WHERE trial = ?', (number,))
        database.execute('DELETE FROM trials WHERE number = ?', (number,))
    if structures:
        left = {
            each
            for (trial,) in database.execute('SELECT number FROM trials').fetchall()
            for each in _structures(database, trial)
        }
        database.executemany(
            'DELETE FROM structures WHERE id = ?', [(each,) for each in structures - left]
        )
    used = used_parts(database)
    for (digest,) in database.execute('SELECT digest FROM parts').fetchall():
        if bytes(digest) not in used:
            database.execute('DELETE FROM parts WHERE digest = ?', (digest,))


def _structures(database: sqlite3.Connection, trial: int) -> Set[str]:
    """Return the ids of the structures of a trial: it may have gone on with a changed script."""
    found = {
        str(structure)
        for (structure,) in database.execute(
            'SELECT structure FROM trials WHERE number = ?', (trial,)
        )
    }
    for name, text in database.execute(
        'SELECT name, text FROM facts JOIN moments ON moment = moments.number WHERE trial = ? '
        "AND facts.path = '' AND name IN (?, ?) AND text IS NOT NULL",
        (trial, STRUCTURE, RENAMED),
    ):
        found.add(
            str(json.loads(text))
            if name == STRUCTURE
            else told_renaming(StoredValue(text, None))[0]
        )
    return found


def used_parts(database: sqlite3.Connection, since: int = 0) -> Set[bytes]:
    """Return the digests of the bytes that a fact refers to, by itself or within its value.

    `since`: the first moment whose facts count.
    """
    used: Set[bytes] = set()
    for (text,) in database.execute(
        "SELECT text FROM facts WHERE moment >= ? AND text LIKE '%$part%'", (since,)
    ):
        used.update(map(bytes.fromhex, _PART.findall(text)))
    wholes = database.execute(
        'SELECT DISTINCT whole FROM facts WHERE moment >= ? AND whole IS NOT NULL', (since,)
    ).fetchall()
    for (digest,) in wholes:
        used.add(bytes(digest))
        for (data,) in database.execute('SELECT data FROM parts WHERE digest = ?', (digest,)):
            used.update(map(bytes.fromhex, _PART.findall(bytes(data).decode('ascii', 'replace'))))
    return used


def check(store: StoreFile) -> None:
    """Check a store that is to be pruned.

    :raises StoreError: where SQLite finds it damaged: nothing is taken out of it then.
    """
    for (found,) in store.integrity():
        if found != 'ok':
            raise StoreError('{}: is damaged ({}); nothing is removed'.format(store.path, found))
