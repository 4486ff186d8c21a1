"""Trials of bags in some folders: found, counted, and read again when somebody opens one.

Bags are files that may come from anywhere: their content is read as messages by their own
definitions, by a process with limits, and never as code. A browser knows a trial by the number
that it was given here.
"""

import fcntl
import itertools
import os
import threading
import time
from typing import Dict, Iterable, List, NamedTuple, Sequence, Tuple

import rospy

from smach_oracle.analysis.bag_events import UNFINISHED, BagError, EventReader
from smach_oracle.analysis.bag_worker import BagReadError, BagReply, BagRequest, ReadTrial
from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.variants import (
    OTHER_END,
    Count,
    VariantCounts,
    count_variant,
    find_variants,
)
from smach_oracle.forking import unlock
from smach_oracle.oracle.errors import OracleError
from smach_oracle.packages import lacking

from ..shapes.trials import BagOverviewView, CountsRowView, CountView, EndingsView, TrialView
from ..web.sections import PageSections
from .bag_folders import BagFolders, FileState
from .bag_process import read_bags
from .counts_table import unwell

SECTION = 'bags'
SCAN_PERIOD_S = 5.0
MOST_BAGS = 500  # the newest
MOST_BYTES = 2**30  # of a bag
MOST_EVENTS = 200000  # in a bag
SHOWN_TRIALS = 300
SHOWN_BROKEN = 50
MOST_BAGS_OF_A_TRIAL = 20  # the newest that were read
MOST_REPLY = 80 * 10**6  # bytes, of all that is replayed of a trial
BEING_WRITTEN_S = 60.0


class RecordedTrialError(OracleError):
    """A trial of a bag cannot be read. The text says why."""


class BagTrial(NamedTuple):
    """A trial and the bags that it is in."""

    number: int
    node: str  # whose it is
    summary: TrialSummary


class BagCatalogue:
    """`run` in a thread of its own, the rest from any thread."""

    def __init__(self, folders: Sequence[str], sections: PageSections) -> None:
        """`folders`: with bags in them or below."""
        self._folders = BagFolders(folders)
        self._sections = sections
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._trials: Dict[str, BagTrial] = {}
        self._read: Dict[str, FileState] = {}  # by path
        self._broken: Dict[str, str] = {}  # why, by path
        self._refused: Dict[str, str] = {}  # what is not even opened: why, by path
        self._notes: List[str] = []

    def run(self) -> None:
        """Scan again and again until the node goes down, and return at once without folders."""
        if not self._folders:
            return
        try:
            EventReader()
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
        waiting = self._fresh()
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
        """Bring the section up to date. `waiting`: so many bags are still to be read."""
        with self._lock:
            trials = sorted(self._trials.values(), key=lambda each: -each.summary.start_time)
            broken = sorted({**self._refused, **self._broken}.items())
        notes = self._notes + (
            ['Of {} trials the latest {} are listed.'.format(len(trials), SHOWN_TRIALS)]
            if len(trials) > SHOWN_TRIALS
            else []
        )
        view: BagOverviewView = {
            'waiting': waiting,
            'note': ' '.join(notes),
            'table': _table([each.summary for each in trials]),
            'trials': [_row(each) for each in trials[:SHOWN_TRIALS]],
            'broken': [
                {'name': self._folders.name_of(path), 'reason': reason[:300]}
                for path, reason in broken[:SHOWN_BROKEN]
            ],
        }
        self._sections.put(SECTION, view)

    def find(self, number: int) -> BagTrial:
        """Return a trial by its number.

        :raises RecordedTrialError: for no such trial.
        """
        with self._lock:
            trial = next((each for each in self._trials.values() if each.number == number), None)
        if trial is None:
            raise RecordedTrialError(
                'There is no trial {} any more; choose it again.'.format(number)
            )
        return trial

    def replayed(self, trial: BagTrial, most_events: int) -> BagReply:
        """Return the first events of a trial, in order, and its machines. Read now.

        :raises RecordedTrialError: where its bags cannot be read any more.
        """
        paths = list(trial.summary.bags)
        try:
            return read_bags(
                self._folders,
                _request(
                    paths,
                    [trial.summary.trial_id],
                    shown_events=most_events,
                    reply_bytes=MOST_REPLY,
                ),
            )
        except BagReadError as err:
            name = self._folders.name_of(paths[err.position])
            raise RecordedTrialError('{}: {}'.format(name, err)) from err
        except FileNotFoundError as err:
            raise RecordedTrialError('A bag of this trial is gone.') from err

    def _fresh(self) -> List[Tuple[str, FileState]]:
        """The bags that are to be read, newest first. It forgets those that are gone."""
        found = self._folders.find()
        self._notes, states = found.missing, found.states
        with self._lock:
            self._refused = found.refused
        kept = sorted(states, key=lambda path: -states[path].changed_ns)
        if len(kept) > MOST_BAGS:
            self._notes.append('Of {} bags the newest {} are read.'.format(len(kept), MOST_BAGS))
        kept = kept[:MOST_BAGS]
        self._forget(set(self._read) - set(kept))
        return [(path, states[path]) for path in kept if self._read.get(path) != states[path]]

    def _forget(self, gone: Iterable[str]) -> None:
        for path in gone:
            self._read.pop(path, None)
            with self._lock:
                self._broken.pop(path, None)
                self._drop(path)

    def _drop(self, path: str) -> None:
        """Forget the trials of a bag, with the lock held. Their other bags are read again."""
        for trial_id in [name for name, each in self._trials.items() if path in each.summary.bags]:
            for bag in self._trials.pop(trial_id).summary.bags:
                if bag != path:
                    self._read.pop(bag, None)

    def _read_bag(self, path: str, state: FileState) -> None:
        """Read one bag."""
        self._read[path] = state
        reason = ''
        try:
            if path.endswith('.active'):
                if self._is_written(path, state):
                    del self._read[path]
                    return  # its trial runs. It is shown live
                raise BagReadError(UNFINISHED)
            if state.size > MOST_BYTES:
                raise BagReadError(
                    'it has {:.1f} GiB; at most {:.0f} are read'.format(
                        state.size / 2**30, MOST_BYTES / 2**30
                    )
                )
            self._count(path)
        except BagError as err:
            reason = str(err)
        except FileNotFoundError:
            del self._read[path]  # it has just got its final name, or is gone: the next scan shows
        with self._lock:
            self._broken.pop(path, None)
            if reason:
                self._broken[path] = reason
                self._drop(path)

    def _is_written(self, path: str, state: FileState) -> bool:
        """Whether it grows, or a living recorder of this machine holds it."""
        if time.time() - state.changed_ns / 1e9 < BEING_WRITTEN_S:
            return True
        descriptor = self._folders.open(path)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
        finally:
            unlock(descriptor)
            os.close(descriptor)
        return False

    def _count(self, path: str) -> None:
        by_bags: Dict[Tuple[str, ...], List[ReadTrial]] = {}
        for read in read_bags(self._folders, _request([path])).trials:
            by_bags.setdefault(self._bags_of(read.summary.trial_id, path), []).append(read)
        for bags, trials in by_bags.items():
            if len(bags) > 1:  # their record is in several bags, as after a full disk
                trials = self._together(bags, [read.summary.trial_id for read in trials])
            for read in trials:
                known = self._trials.get(read.summary.trial_id)
                number = known.number if known else next(self._numbers)
                with self._lock:
                    self._trials[read.summary.trial_id] = BagTrial(
                        number, read.node, read.summary._replace(bags=bags)
                    )

    def _bags_of(self, trial_id: str, path: str) -> Tuple[str, ...]:
        """The bags that a trial is in, that of `path` last."""
        known = self._trials.get(trial_id)
        others = [each for each in known.summary.bags if each != path] if known else []
        return tuple(others[1 - MOST_BAGS_OF_A_TRIAL :] + [path])

    def _together(self, bags: Sequence[str], trial_ids: List[str]) -> List[ReadTrial]:
        try:
            return read_bags(self._folders, _request(list(bags), trial_ids)).trials
        except BagReadError as err:
            raise BagReadError(
                '{}: {}'.format(self._folders.name_of(bags[err.position]), err)
            ) from err


def _request(paths: List[str], trials: Sequence[str] = (), **more: int) -> BagRequest:
    return BagRequest(paths, list(trials), most_events=MOST_EVENTS, **more)


def _row(trial: BagTrial) -> TrialView:
    """A trial as the list of live trials has it, too."""
    summary = trial.summary
    return {
        'number': trial.number,
        'id': summary.trial_id,
        'robot': trial.node,
        'experiment': summary.experiment,
        'start': summary.start_time,
        'end': summary.start_time + summary.duration_s,
        'ending': summary.ending.value,
        'outcome': summary.outcome,
        'oracle': summary.recovers,
        'failures': summary.failures,
        'recoveries': summary.recoveries,
        'questions': summary.questions,
        'answered': summary.answered,
        'lost': summary.lost_events,
        'detailed': True,
        'bag': os.path.basename(summary.bags[-1]),
    }


def _table(summaries: Sequence[TrialSummary]) -> List[CountsRowView]:
    """The counts of Table I, by the analysis of bags."""
    if not summaries:
        return []
    rows: List[CountsRowView] = []
    for found in find_variants(list(summaries)):
        variant = count_variant(found)
        rows.append(
            {
                'experiment': variant.experiment,
                'arm': variant.name,
                'trials': variant.trials,
                'endings': _endings(variant),
                'counts': {
                    'failures': _count(variant.of('failures of states')),
                    'recoveries': _count(variant.of('oracle recoveries')),
                    'questions': _count(variant.of('questions to the expert')),
                    'answered': _count(variant.of('answered')),
                },
                'unwell_s': unwell(found.trials),
            }
        )
    return rows


def _endings(variant: VariantCounts) -> EndingsView:
    view: EndingsView = {
        'success': variant.of('ended in success').trials,
        'failure': variant.of('ended in failure').trials,
        'preempted': variant.of('preempted').trials,
        'unfinished': variant.of('unfinished').trials,
    }
    if variant.has(OTHER_END):
        view['other'] = variant.of(OTHER_END).trials
    return view


def _count(count: Count) -> CountView:
    return {'trials': count.trials, 'events': count.events}
