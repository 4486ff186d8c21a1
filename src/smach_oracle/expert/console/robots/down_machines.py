"""Machines that are down: their program has stopped, and their trial in a store has not ended."""

import os
import shlex
import threading
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.store.errors import StoreError
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.names import EDIT
from smach_oracle.store.rows import StoredMoment, StoredTrial
from smach_oracle.store.stopped_trial import StoppedTrial, in_words, trial_to_change
from smach_oracle.store.store_file import StoreFile

from ..shapes.robots import DownMachineView
from ..web.sections import PageSections

MOST_MACHINES = 50  # of a store, those that were stopped last
MOST_KEYS = 200  # of the userdata of one
MOST_STATES = 1000  # of one, where it can go on
BUSY_S = 2.0  # how long a change waits for others, and for a look
NOT_DOWN = 'There is no machine {} here that is down.'
BUSY = 'The stores are being read or changed, and have been for {:g} s: try again.'
_Stamp = Tuple[object, ...]


class _Looked(NamedTuple):
    """The rows of a store, read when its files had this `stamp`."""

    stamp: _Stamp
    rows: List[DownMachineView]


class DownMachines:
    """Looks at stores again and again, and changes what is in them. Any thread may use it.

    A machine that a living process holds is not down.
    """

    def __init__(self, stores: Sequence[str], sections: PageSections) -> None:
        """`stores`: paths of stores. One that is not there yet may come."""
        self._stores, self._sections = tuple(stores), sections
        self._looked: Dict[str, _Looked] = {}
        # a look must not take a change of our own for a program that holds the machine
        self._lock = threading.Lock()

    def look(self) -> None:
        """Bring the section up to date."""
        if self._stores:
            with self._lock:
                self._look()

    def change(self, key: str, seen: int, work: Callable[[StoppedTrial], str]) -> str:
        """Have a machine changed that was down at the last look, and return what `work` does.

        :param key: of its row.
        :param seen: the moment that its row had.
        :raises StoreError: where there is none, it has gone on since, or a program holds it. Where
            the stores do not answer in time, and what `work` raises.
        """
        if not self._lock.acquire(timeout=BUSY_S):
            raise StoreError(BUSY.format(BUSY_S))
        try:
            row = self._row_of(key)
            if row is None:
                raise StoreError(NOT_DOWN.format(key))
            with trial_to_change(row['store'], row['trial'], seen) as stopped:
                done = work(stopped)
            self._look()
            return done
        finally:
            self._lock.release()

    def _row_of(self, key: str) -> Optional[DownMachineView]:
        """Return the row of a machine of our stores. It may be held by now."""
        for path in self._stores:
            looked = self._looked.get(path)
            for row in looked.rows if looked is not None else ():
                if row['key'] == key and row['machine']:
                    return row
        return None

    def _look(self) -> None:
        self._sections.put('down', [row for path in self._stores for row in self._rows(path)])

    def _rows(self, path: str) -> List[DownMachineView]:
        stamp = _stamp(path)
        looked = self._looked.get(path)
        if looked is None or looked.stamp != stamp:
            looked = self._looked[path] = _Looked(stamp, _read(path))
        try:
            return [
                row
                for row in looked.rows
                if not row['machine'] or not MachineLock(path, row['machine']).is_held_elsewhere()
            ]
        except StoreError as err:
            return [_problem(path, err)]


def _stamp(path: str) -> _Stamp:
    """Return what changes with each commit to a store."""
    found: List[object] = []
    for name in (path, path + '-wal'):
        try:
            status = os.stat(name)
            found += [status.st_mtime_ns, status.st_size, status.st_ino]
        except OSError:
            found.append(None)
    return tuple(found)


def _read(path: str) -> List[DownMachineView]:
    try:
        store = StoreFile(path, read_only=True)
    except StoreError as err:
        return [_problem(path, err)]
    try:
        latest = {trial.machine: trial for trial in store.trials()}  # the last one of each
        stopped = [trial for trial in latest.values() if trial.ended is None and trial.moments]
        return [_row(store, trial) for trial in stopped[-MOST_MACHINES:]]
    except (StoreError, ValueError, KeyError, IndexError, TypeError) as err:
        return [_problem(path, err)]
    finally:
        store.close()


def _row(store: StoreFile, trial: StoredTrial) -> DownMachineView:
    stopped = StoppedTrial(store, trial)
    userdata = list(stopped.userdata())
    return {
        'key': '{}#{}'.format(store.path, trial.number),
        'store': store.path,
        'machine': trial.machine,
        'trial': trial.number,
        'moment': stopped.latest,
        'since': _stored_last(store.moments(trial.number)),
        'states': stopped.states()[:MOST_STATES],
        'stood': [in_words(standing) for standing in stopped.places()],
        'questions': [
            '{} about {}'.format(question, path) for path, question in stopped.questions()
        ],
        'userdata': userdata[:MOST_KEYS],
        'more_userdata': max(0, len(userdata) - MOST_KEYS),
        'command': 'rosrun smach_oracle oracle_state {} show --trial {}'.format(
            shlex.quote(store.path), trial.number
        ),
        'problem': '',
    }


def _stored_last(moments: Sequence[StoredMoment]) -> float:
    """Return when its program stored something last, s since the epoch. Edits are ignored."""
    return next((each.at for each in reversed(moments) if each.kind != EDIT), moments[-1].at)


def _problem(path: str, err: Exception) -> DownMachineView:
    return {
        'key': path,
        'store': path,
        'machine': '',
        'trial': 0,
        'moment': 0,
        'since': 0.0,
        'states': [],
        'stood': [],
        'questions': [],
        'userdata': [],
        'more_userdata': 0,
        'command': '',
        'problem': str(err),
    }
