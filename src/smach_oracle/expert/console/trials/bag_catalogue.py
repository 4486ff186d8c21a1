"""Trials of bags in some folders: found, counted, and read again when somebody opens one.

Bags are files that may come from anywhere: their content is read as messages by their own
definitions, bounded, and never as code. A browser knows a trial by the number that it was given
here.
"""
import fcntl
import itertools
import os
import threading
import time
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import rospy

from smach_oracle.analysis.bag_events import BagContent, BagError, EventReader, find_bags
from smach_oracle.analysis.trials import TrialSummary, summarise
from smach_oracle.analysis.variants import Count, count_variants
from smach_oracle.oracle.errors import OracleError
from smach_oracle.oracle.records.events import Event
from smach_oracle.packages import lacking

from ..web.sections import PageSections

SECTION = 'bags'
SCAN_PERIOD_S = 5.0
MOST_BAGS = 500  # the newest
MOST_BYTES = 2 ** 30  # of a bag
MOST_EVENTS = 200000  # in a bag
SHOWN_TRIALS = 300
SHOWN_BROKEN = 50
BEING_WRITTEN_S = 60.0
_COUNTS = {
    'failures': 'failures of states', 'recoveries': 'oracle recoveries',
    'questions': 'questions to the expert', 'answered': 'answered'
}
_ENDINGS = {'success': 'ended in success', 'failure': 'ended in failure', 'preempted': 'preempted',
            'unfinished': 'unfinished'}


class RecordedTrialError(OracleError):
    """A trial of a bag cannot be read; the text says why."""


class BagTrial(NamedTuple):
    """A trial and the bags that it is in."""

    number: int
    node: str  # whose it is
    summary: TrialSummary


class BagCatalogue:
    """`run` in a thread of its own; the rest from any thread."""

    def __init__(self, folders: Sequence[str], sections: PageSections) -> None:
        """`folders`: with bags in them or below."""
        self._folders = list(folders)
        self._sections = sections
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._trials: Dict[str, BagTrial] = {}
        self._read: Dict[str, Tuple[int, int]] = {}  # path -> size and ns of the last change
        self._broken: Dict[str, str] = {}
        self._notes: List[str] = []
        self._reader: Optional[EventReader] = None

    def run(self) -> None:
        """Scan again and again until the node goes down; return at once without folders."""
        if not self._folders:
            return
        try:
            self._reader = EventReader(MOST_EVENTS)
        except ImportError as err:  # it needs rosbags, which not every robot has
            self._notes = [lacking(err) or str(err)]
            self.write_sections(0)
            return
        while not rospy.is_shutdown():
            try:
                self.scan()
            except Exception as err:  # a file in a folder must not end the scanning
                rospy.logerr_throttle(60, 'The bags could not be scanned: {!r}'.format(err))
            time.sleep(SCAN_PERIOD_S)

    def scan(self) -> None:
        """Read the bags that are new or have changed."""
        waiting = self._fresh(self._found())
        drawn_s = -SCAN_PERIOD_S
        for position, (path, state) in enumerate(waiting):
            began_s = time.monotonic()
            self._read_bag(path, state)
            if rospy.is_shutdown():
                return
            if time.monotonic() - drawn_s > SCAN_PERIOD_S / 2:
                self.write_sections(len(waiting) - position - 1)
                drawn_s = time.monotonic()
            time.sleep(min(0.5, time.monotonic() - began_s))  # the pages come first
        self.write_sections(0)

    def write_sections(self, waiting: int) -> None:
        """Bring the section up to date; `waiting`: so many bags are still to be read."""
        with self._lock:
            trials = sorted(self._trials.values(), key=lambda each: -each.summary.start_time)
            broken = sorted(self._broken.items())
        notes = self._notes + ([
            'Of {} trials the latest {} are listed.'.format(len(trials), SHOWN_TRIALS)
        ] if len(trials) > SHOWN_TRIALS else [])
        self._sections.put(
            SECTION, {
                'waiting': waiting, 'note': ' '.join(notes), 'table': _table(
                    [each.summary
                     for each in trials]), 'trials': [_row(each) for each in trials[:SHOWN_TRIALS]],
                'broken': [{'name': self._short(path), 'reason': reason[:300]}
                           for path, reason in broken[:SHOWN_BROKEN]]
            })

    def events(self, number: int) -> Tuple[BagTrial, List[Event]]:
        """A trial with all its events, in order; read now.

        :raises RecordedTrialError: for no such trial, or bags that cannot be read any more.
        """
        with self._lock:
            trial = next((each for each in self._trials.values() if each.number == number), None)
        if trial is None:
            raise RecordedTrialError(
                'There is no trial {} any more; choose it again.'.format(number))
        by_number: Dict[int, Event] = {}
        for path in trial.summary.bags:
            for event in self._content(path).events:
                if event.trial_id == trial.summary.trial_id:
                    by_number[event.seq] = event
        return trial, [by_number[seq] for seq in sorted(by_number)]

    def _content(self, path: str) -> BagContent:
        try:
            return self._read_events(path)
        except BagError as err:
            raise RecordedTrialError('{}: {}'.format(self._short(path), err)) from err

    def _read_events(self, path: str) -> BagContent:
        """Everything in a bag.

        :raises BagError: where it cannot be read.
        """
        if self._reader is None:
            raise BagError('no bag can be read here: rosbags is missing')
        return self._reader.read(path)

    def _found(self) -> List[str]:
        self._notes, paths = [], []
        for folder in self._folders:
            try:
                paths += find_bags([folder])
            except BagError as err:
                self._notes.append('{}.'.format(err))
        return list(dict.fromkeys(paths))

    def _fresh(self, paths: Iterable[str]) -> List[Tuple[str, Tuple[int, int]]]:
        """The bags that are to be read, newest first; forgets those that are gone."""
        states: Dict[str, Tuple[int, int]] = {}
        for path in paths:
            try:
                found = os.stat(path)
            except OSError:
                continue
            states[path] = (found.st_size, found.st_mtime_ns)
        kept = sorted(states, key=lambda path: -states[path][1])
        if len(kept) > MOST_BAGS:
            self._notes.append('Of {} bags the newest {} are read.'.format(len(kept), MOST_BAGS))
        kept = kept[:MOST_BAGS]
        self._forget(set(self._read) - set(kept))
        return [(path, states[path]) for path in kept if self._read.get(path) != states[path]]

    def _forget(self, gone: Iterable[str]) -> None:
        for path in gone:
            del self._read[path]
            with self._lock:
                self._broken.pop(path, None)
                self._drop(path)

    def _drop(self, path: str) -> None:
        """Forget the trials of a bag; with the lock held."""
        for trial_id in [name for name, each in self._trials.items() if path in each.summary.bags]:
            del self._trials[trial_id]

    def _read_bag(self, path: str, state: Tuple[int, int]) -> None:
        """Read one bag."""
        self._read[path] = state
        reason = ''
        try:
            if path.endswith('.active') and (time.time() - state[1] / 1e9 < BEING_WRITTEN_S
                                             or _is_written(path)):
                del self._read[path]
                return  # its trial runs; it is shown live
            if state[0] > MOST_BYTES:
                raise RecordedTrialError('it has {:.1f} GiB; at most {:.0f} are read'.format(
                    state[0] / 2**30, MOST_BYTES / 2**30))
            self._count(path)
        except OracleError as err:
            reason = str(err).replace(path, self._short(path))
        except OSError:
            del self._read[path]  # it has just got its final name, or is gone: the next scan shows
        with self._lock:
            self._broken.pop(path, None)
            if reason:
                self._broken[path] = reason
                self._drop(path)

    def _count(self, path: str) -> None:
        content = self._read_events(path)
        by_trial: Dict[str, Dict[int, Event]] = {}
        for event in content.events:
            by_trial.setdefault(event.trial_id, {})[event.seq] = event
        for trial_id, events in by_trial.items():
            known = self._trials.get(trial_id)
            others = [each for each in known.summary.bags if each != path] if known else []
            for other in others:  # its record is in several bags, as after a full disk
                events.update((event.seq, event) for event in self._content(other).events
                              if event.trial_id == trial_id)
            summary = summarise(list(events.values()), tuple(others + [path]))
            with self._lock:
                self._trials[trial_id] = BagTrial(known.number if known else next(self._numbers),
                                                    content.nodes.get(trial_id, ''), summary)

    def _short(self, path: str) -> str:
        """A bag's name below its folder."""
        return short_name(path, self._folders)


def _is_written(path: str) -> bool:
    """Whether a living recorder of this machine holds it."""
    with open(path, 'rb') as bag:
        try:
            fcntl.flock(bag.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def short_name(path: str, folders: Sequence[str]) -> str:
    """A bag's path below the folder that it was found in."""
    for folder in (os.path.realpath(each) for each in folders):
        if path.startswith(folder + os.sep):
            return path[len(folder) + 1:]
    return os.path.basename(path)


def _row(trial: BagTrial) -> Dict[str, Any]:
    """A trial as the list of live trials has it, too."""
    summary = trial.summary
    return {
        'number': trial.number, 'id': summary.trial_id, 'robot': trial.node,
        'experiment': summary.experiment, 'start': summary.start_time,
        'end': summary.start_time + summary.duration_s, 'ending': summary.ending.value,
        'outcome': summary.outcome, 'oracle': summary.recovers, 'failures': summary.failures,
        'recoveries': summary.recoveries, 'questions': summary.questions,
        'answered': summary.answered, 'lost': summary.lost_events, 'detailed': True,
        'bag': os.path.basename(summary.bags[-1])
    }


def _table(summaries: Sequence[TrialSummary]) -> List[Dict[str, Any]]:
    """The counts of Table I, by the analysis of bags."""
    if not summaries:
        return []
    rows = []
    for variant in count_variants(list(summaries)):
        rows.append({'experiment': variant.experiment, 'arm': variant.name,
                     'trials': variant.trials,
                     'endings': {key: variant.of(name).trials for key, name in _ENDINGS.items()},
                     'counts': {key: _count(variant.of(name)) for key, name in _COUNTS.items()}})
    return rows


def _count(count: Count) -> Dict[str, Optional[int]]:
    return {'trials': count.trials, 'events': count.events}
