"""Machines that are down: their program has stopped, and their trial in a store has not ended."""
import os
import shlex
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

from smach_oracle.store.errors import StoreError
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.rows import StoredTrial
from smach_oracle.store.stopped_trial import StoppedTrial, in_words
from smach_oracle.store.store_file import StoreFile

from ..web.sections import PageSections

MOST_MACHINES = 50  # of a store, those that were stopped last
MOST_KEYS = 200  # of the userdata of one
_Stamp = Tuple[object, ...]


class _Looked(NamedTuple):
    """What a store had when its files were as `stamp` says."""

    stamp: _Stamp
    rows: List[Dict[str, Any]]


class DownMachines:
    """Looks at stores again and again; changes nothing in them.

    A machine that a living process holds is not down.
    """

    def __init__(self, stores: Sequence[str], sections: PageSections) -> None:
        """`stores`: paths of stores; one that is not there yet may come."""
        self._stores, self._sections = tuple(stores), sections
        self._looked: Dict[str, _Looked] = {}

    def look(self) -> None:
        """Bring the section up to date."""
        if self._stores:
            self._sections.put('down', [row for path in self._stores for row in self._rows(path)])

    def _rows(self, path: str) -> List[Dict[str, Any]]:
        stamp = _stamp(path)
        looked = self._looked.get(path)
        if looked is None or looked.stamp != stamp:
            looked = self._looked[path] = _Looked(stamp, _read(path))
        try:
            return [row for row in looked.rows if not row['machine'] or not MachineLock(
                path, row['machine']).is_held_elsewhere()]
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


def _read(path: str) -> List[Dict[str, Any]]:
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


def _row(store: StoreFile, trial: StoredTrial) -> Dict[str, Any]:
    stopped = StoppedTrial(store, trial)
    userdata = list(stopped.userdata())
    return {
        'key': '{}#{}'.format(store.path, trial.number), 'store': store.path,
        'machine': trial.machine, 'since': store.moments(trial.number)[-1].at,
        'stood': [in_words(standing) for standing in stopped.places()],
        'questions': ['{} about {}'.format(question, path)
                      for path, question in stopped.questions()],
        'userdata': [list(each) for each in userdata[:MOST_KEYS]],
        'more_userdata': max(0, len(userdata) - MOST_KEYS),
        'command': 'rosrun smach_oracle oracle_state {} show --trial {}'.format(
            shlex.quote(store.path), trial.number),
        'problem': ''}


def _problem(path: str, err: Exception) -> Dict[str, Any]:
    return {'key': path, 'store': path, 'machine': '', 'since': 0.0, 'stood': [], 'questions': [],
            'userdata': [], 'more_userdata': 0, 'command': '', 'problem': str(err)}
