"""The bags of a folder: which trials each has, who holds it, and how it goes."""

import fcntl
import glob
import json
import os
from typing import Callable, Dict, List, NamedTuple, Set, Tuple

from smach_oracle.forking import unlock
from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.records.facts import CAN_GO_ON, ENDED_BY, TrialEnd

from .limits import KnownBag, Plan, Removal

_ENDS_QUESTION = (
    OracleEvent.QUERY_ANSWERED,
    OracleEvent.QUERY_EXPIRED,
    OracleEvent.QUERY_CANCELLED,
)
_BESIDE = ('.active', '.mending', '.damaged')  # files of a bag that is not done with
NOT_OURS = 'it has no events of the executive'

Say = Callable[[str], None]


class _TrialsOfBag(NamedTuple):
    """The trials that a bag names, those of them that have ended, and why the bag is kept."""

    trials: Tuple[str, ...]
    ended: Tuple[str, ...]
    why_kept: str


class BagFolder:
    """Remembers what it has read, since every bag is looked at after each trial."""

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self._read: Dict[Tuple[str, int, int], _TrialsOfBag] = {}

    def totals(self) -> Tuple[int, float]:
        """Return the bytes of all bags, and when the oldest was closed, s since the epoch."""
        found = [status for _, status in self._files()]
        return (
            sum(status.st_size for status in found),
            min([status.st_mtime for status in found], default=float('inf')),
        )

    def bags(self) -> List[KnownBag]:
        """Return all bags of the folder itself, none of those that are being written.

        :raises OSError: where the folder cannot be read.
        """
        opened = _open_files()
        found, read = [], {}
        for path, status in self._files():
            key = (path, status.st_size, status.st_mtime_ns)
            told = read[key] = self._read.get(key) or _trials_of(path)
            why = told.why_kept or _why_held(path, opened)
            found.append(
                KnownBag(path, status.st_size, status.st_mtime, told.trials, told.ended, why)
            )
        self._read = read
        return found

    def _files(self) -> List[Tuple[str, os.stat_result]]:
        os.listdir(self._folder)  # raises where it is gone
        found = []
        for path in sorted(glob.glob(os.path.join(glob.escape(self._folder), '*.bag'))):
            try:
                if os.path.isfile(path) and not os.path.islink(path):
                    found.append((path, os.stat(path)))
            except FileNotFoundError:
                continue
        return found


def _trials_of(path: str) -> _TrialsOfBag:
    """Read which trials a bag has, and which of them it sees end."""
    import rosbag  # half a second, and not before there is something to remove

    trials: Dict[str, Set[str]] = {}  # with their open questions
    ended: List[str] = []
    try:
        with rosbag.Bag(path) as bag:
            for _, event, _ in bag.read_messages(connection_filter=_is_of_events):
                waiting = trials.setdefault(event.trial_id, set())
                if event.kind == OracleEvent.QUERY_OPENED:
                    waiting.add(event.query_id)
                elif event.kind in _ENDS_QUESTION:
                    waiting.discard(event.query_id)
                elif event.kind == OracleEvent.TRIAL_END and not _can_go_on(event):
                    ended.append(event.trial_id)
    except Exception as err:  # a damaged file can make rosbag raise anything
        return _TrialsOfBag((), (), 'it cannot be read: {!r}'.format(err))
    done = tuple(trial for trial in ended if not trials[trial])
    return _TrialsOfBag(tuple(trials), done, '' if trials else NOT_OURS)


def _can_go_on(end: OracleEvent) -> bool:
    data = json.loads(end.data or '{}')
    # bags of earlier versions tell only that it is asked about
    return bool(data.get(CAN_GO_ON)) or data.get(ENDED_BY) == TrialEnd.KEPT.value


def _is_of_events(topic: str, kind: str, md5sum: str, definition: str, header: object) -> bool:
    return kind == OracleEvent._type


def _open_files() -> Set[str]:
    """Return what processes of this user have open, as far as the system tells."""
    found = set()
    for link in glob.iglob('/proc/[0-9]*/fd/*'):
        try:
            target = os.readlink(link)
        except OSError:
            continue  # it was closed meanwhile, or is another user's
        if target.endswith('.bag'):
            found.add(target)
    return found


def _why_held(path: str, opened: Set[str]) -> str:
    if os.path.realpath(path) in opened:
        return 'a program has it open'
    for suffix in _BESIDE:
        if os.path.exists(path + suffix):
            return 'it is being written or mended'
    return _why_locked(path)


def _why_locked(path: str) -> str:
    try:
        with open(path, 'rb') as bag:
            fcntl.flock(bag.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            unlock(bag.fileno())
    except BlockingIOError:
        return 'a program holds it by a lock'
    except OSError as err:
        return 'it cannot be opened: {}'.format(err)
    return ''


def told(removal: Removal) -> str:
    """Return a line about a bag."""
    return '{}: {:.1f} MB, {}'.format(removal.bag.path, removal.bag.size / 1e6, removal.why)


def remove(plan: Plan, say: Say, warn: Say) -> int:
    """Remove what the plan names, each after a line about it, and return how many are gone.

    One that has changed or is held by now stays.
    """
    gone = 0
    for removal in plan.removals:
        path = removal.bag.path
        why = _why_held(path, _open_files())
        try:
            if os.stat(path).st_size != removal.bag.size:
                why = 'it has changed'
            if why:
                warn('{} stays: {}'.format(path, why))
                continue
            say('removes ' + told(removal))
            os.unlink(path)
            gone += 1
        except OSError as err:
            warn('{} stays: {}'.format(path, err))
    return gone
