"""The trials that go from a store: those that have ended, the oldest first."""

import json
import re
import sqlite3
from typing import Counter, Dict, Iterable, Iterator, List, NamedTuple, Set, Union

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
            shared = _SharedParts(database) if self._size else None
            for trial in trials:
                why = self._why(database, trial, now)
                if not why:
                    continue
                stays = TELLS_IT if trial.number in asked else self._why_kept(trial)
                (self.kept if stays else self.going).append(Dropped(trial, stays or why))
                if not stays and shared is not None:
                    shared.take_out([trial.number])

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
                _SharedParts(database).take_out(numbers)
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


class _SharedParts:
    """What trials share: structures by their ids, parts of values by their digests.

    All facts are looked through once, since thousands of trials may go.
    """

    def __init__(self, database: sqlite3.Connection) -> None:
        self._database = database
        self._of: Dict[int, Set[Union[str, bytes]]] = {}  # by trial
        for trial, structure in database.execute('SELECT number, structure FROM trials'):
            self._of[trial] = {str(structure)}
        self._find_structures()
        self._find_parts()
        self._uses = Counter(each for found in self._of.values() for each in found)
        # what nothing refers to: parts that an earlier program has added, and a later one thinned
        self._unused: Set[Union[str, bytes]] = {
            digest
            for (digest,) in database.execute('SELECT digest FROM parts')
            if digest not in self._uses
        }

    def _find_structures(self) -> None:
        """Find those with which a trial has gone on: its script may have changed."""
        for trial, name, text in self._database.execute(
            'SELECT trial, name, text FROM facts JOIN moments ON moment = moments.number '
            "WHERE facts.path = '' AND name IN (?, ?) AND text IS NOT NULL",
            (STRUCTURE, RENAMED),
        ):
            self._of.setdefault(trial, set()).add(
                str(json.loads(text))
                if name == STRUCTURE
                else told_renaming(StoredValue(text, None))[0]
            )

    def _find_parts(self) -> None:
        for trial, text in self._database.execute(
            'SELECT trial, text FROM facts JOIN moments ON moment = moments.number '
            "WHERE text LIKE '%$part%'"
        ):
            self._of.setdefault(trial, set()).update(_parts_in(text))
        within: Dict[bytes, Set[bytes]] = {}
        for trial, digest in self._database.execute(
            'SELECT DISTINCT trial, whole FROM facts JOIN moments ON moment = moments.number '
            'WHERE whole IS NOT NULL'
        ):
            if digest not in within:
                within[digest] = {digest, *_parts_within(self._database, digest)}
            self._of.setdefault(trial, set()).update(within[digest])

    def take_out(self, trials: Iterable[int]) -> None:
        """Take out trials that have ended, and what no other trial refers to."""
        for number in trials:  # each has ended: see `_why_kept`
            self._database.execute(
                'DELETE FROM facts WHERE moment IN (SELECT number FROM moments WHERE trial = ?)',
                (number,),
            )
            self._database.execute('DELETE FROM moments WHERE trial = ?', (number,))
            self._database.execute('DELETE FROM trials WHERE number = ?', (number,))
            found = self._of.pop(number, set())
            self._uses.subtract(found)
            self._unused.update(each for each in found if not self._uses[each])
        for each in self._unused:
            self._database.execute('DELETE FROM structures WHERE id = ?', (each,))
            self._database.execute('DELETE FROM parts WHERE digest = ?', (each,))
        self._unused.clear()


def _parts_in(text: str) -> Iterator[bytes]:
    """Yield the digests of the parts to which a text refers."""
    return map(bytes.fromhex, _PART.findall(text))


def _parts_within(database: sqlite3.Connection, digest: bytes) -> Iterator[bytes]:
    """Yield those to which a value refers that is a part as a whole."""
    for (data,) in database.execute('SELECT data FROM parts WHERE digest = ?', (digest,)):
        yield from _parts_in(bytes(data).decode('ascii', 'replace'))


def used_parts(database: sqlite3.Connection, since: int = 0) -> Set[bytes]:
    """Return the digests of the bytes that a fact refers to, by itself or within its value.

    `since`: the first moment whose facts count.
    """
    used: Set[bytes] = set()
    for (text,) in database.execute(
        "SELECT text FROM facts WHERE moment >= ? AND text LIKE '%$part%'", (since,)
    ):
        used.update(_parts_in(text))
    wholes = database.execute(
        'SELECT DISTINCT whole FROM facts WHERE moment >= ? AND whole IS NOT NULL', (since,)
    ).fetchall()
    for (digest,) in wholes:
        used.update((bytes(digest), *_parts_within(database, digest)))
    return used


def check(store: StoreFile) -> None:
    """Check a store that is to be pruned.

    :raises StoreError: where SQLite finds it damaged: nothing is taken out of it then.
    """
    for (found,) in store.integrity():
        if found != 'ok':
            raise StoreError('{}: is damaged ({}); nothing is removed'.format(store.path, found))
