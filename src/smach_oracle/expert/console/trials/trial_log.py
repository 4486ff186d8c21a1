"""Trials heard of live: their events, their counts, and which recoveries helped.

Thread-safe, bounded.
"""

import json
import threading
from collections import OrderedDict
from typing import List, Optional, Sequence, Tuple, Union

from smach_oracle.analysis.trial_counter import TrialCounter, TrialEnding
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.settings.failure_rule import EndMeaning, FailureRule

from ..feeds.told_trials import ToldTrial
from ..feeds.views import event_view
from ..shapes.trials import TrialOverviewView, TrialView
from .counts_table import counts_table, has_oracle
from .packed_texts import PackedTexts
from .recovery_statistics import RecoveryCounts, RecoveryStatistics
from .ways import Level, TrialWays

MOST_TRIALS = 1000
# of so many trials the events are kept, of the others the counts. Those that run come first
MOST_DETAILED = 60
MOST_EVENTS = 4000  # of a trial: the first ones
MOST_BYTES = 16 * 2**20  # of the events of all trials, as they are kept
SHOWN_TRIALS = 300
GONE = 'the robot is gone'
UNHEARD_END = 'its end was not heard'
KEPT = 'kept to go on later'
_NOT_WELL = (EndMeaning.FAILURE, EndMeaning.PREEMPTED)


class _LoggedTrial:
    """One trial."""

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.missing = ''  # why its end was not heard
        self.heard = TrialCounter()
        self.told: Optional[ToldTrial] = None  # as its robot counts it, where it says so
        self.last_seq = -1  # of the events heard
        self.events = PackedTexts()  # each as JSON
        self.detailed = True  # whether the events are kept

    @property
    def counts(self) -> Union[TrialCounter, ToldTrial]:
        """Return the counts that know most: the robot's own, unless later events were heard."""
        told = self.told
        if told is None or (self.heard.last_seq > told.last_seq and not self.heard.lost_events):
            return self.heard
        return told

    @property
    def ended(self) -> bool:
        """Whether it is known to have ended."""
        return self.counts.ending is not TrialEnding.UNFINISHED


class TrialLog:
    """The log of trials. ROS threads feed it, and the thread that serves the pages reads it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._trials: 'OrderedDict[str, _LoggedTrial]' = OrderedDict()
        self._recoveries = RecoveryStatistics()
        self._ways = TrialWays()
        self._version = 0
        self._bytes = 0  # of the events of all trials

    @property
    def version(self) -> int:
        """Grows with every change."""
        return self._version

    @property
    def bytes_kept(self) -> int:
        """Return what the events of all trials take."""
        return self._bytes

    def add(self, robot: str, event: Event) -> bool:
        """Take in one event of a robot. Return whether it is a new one."""
        ended = event.kind in (EventKind.CONTAINER_END, EventKind.TRIAL_END)
        with self._lock:
            self._version += 1
            trial = self._known(robot, event.trial_id)
            if event.seq <= trial.last_seq:
                return False  # it was heard: a bag of the trial is played
            trial.last_seq = event.seq
            trial.heard.add(event)
            self._ways.add(event)
            if trial.detailed and len(trial.events) < MOST_EVENTS:
                before = trial.events.size
                trial.events.append(json.dumps(event_view(event), allow_nan=False))
                self._bytes += trial.events.size - before
                if self._bytes > MOST_BYTES:
                    self._forget_events()
            self._recoveries.add(
                robot,
                event,
                ended
                and (not event.outcome or trial.heard.rule.meaning(event.outcome) in _NOT_WELL),
            )
        return True

    def take_told(self, robot: str, told: Sequence[ToldTrial]) -> None:
        """Take in the latest trials of a robot's machines, as the robot tells them.

        One that ended before anything was heard of it is left out.
        """
        with self._lock:
            self._version += 1
            for each in told:
                if each.trial_id in self._trials or each.running:
                    trial = self._known(robot, each.trial_id)
                    trial.told, trial.missing = each, ''
                self._end_earlier(robot, each)

    def end_missing(self, robot: str) -> None:
        """A robot is gone: what still ran there has ended without a word."""
        with self._lock:
            self._version += 1
            for trial in self._trials.values():
                if trial.robot == robot and not trial.ended:
                    trial.missing = GONE

    def overview(self) -> TrialOverviewView:
        """Return the table of counts and the latest trials, newest first, as plain data."""
        with self._lock:
            latest = list(self._trials.items())[-SHOWN_TRIALS:]
            latest.sort(key=lambda item: item[1].counts.start_time)
            trials = [_row(trial_id, trial) for trial_id, trial in latest]
            return {
                'table': counts_table(trial.counts for trial in self._trials.values()),
                'trials': trials[::-1],
                'heard': len(self._trials),
            }

    def events(self, trial_id: str, start: int, most: int = MOST_EVENTS) -> List[str]:
        """Return up to `most` events of a trial from a position on, each as JSON.

        There are none where the trial is not known, or its events are not kept.
        """
        with self._lock:
            trial = self._trials.get(trial_id)
            return trial.events.lines(start, most) if trial else []

    def rule(self, trial_id: str) -> FailureRule:
        """Return the rule that tells failures in a trial: by name, where nobody has told it."""
        with self._lock:
            trial = self._trials.get(trial_id)
            told = trial.told.rule if trial and trial.told else None
            if told is None and trial and trial.heard.trial_id and not trial.heard.lost_events:
                told = trial.heard.rule  # that of its start
            return told or FailureRule()

    def recovery_counts(self, place: Tuple[str, str, str], target: str) -> RecoveryCounts:
        """Return how often going to `target` helped after a failure.

        :param place: robot, path and label of the state that failed.
        """
        with self._lock:
            return self._recoveries.recovery_counts(place, target)

    def way_above(self, trial_id: str, path: str) -> List[Level]:
        """Return the visits of the containers around one of a trial, the outermost first."""
        with self._lock:
            return self._ways.above(trial_id, path)

    def _known(self, robot: str, trial_id: str) -> _LoggedTrial:
        """The trial of an id, also one that is new; with the lock held."""
        trial = self._trials.get(trial_id)
        if trial is None:
            trial = self._trials[trial_id] = _LoggedTrial(robot)
            self._forget()
        return trial

    def _end_earlier(self, robot: str, latest: ToldTrial) -> None:
        """End the earlier trials of a machine whose ends were not heard; with the lock held."""
        for trial_id, trial in self._trials.items():
            counts = trial.counts
            if (
                trial_id != latest.trial_id
                and trial.robot == robot
                and not trial.ended
                and counts.experiment == latest.experiment
                and counts.start_time < latest.start_time
            ):
                trial.missing = UNHEARD_END

    def _forget(self) -> None:
        """Make room for a new trial; with the lock held."""
        while len(self._trials) > MOST_TRIALS:
            self._drop_events(self._trials.popitem(last=False)[1])
        self._forget_events()

    def _forget_events(self) -> None:
        """Drop the events of some trials where those of all are too many; with the lock held."""
        detailed = [trial for trial in self._trials.values() if trial.detailed]
        while len(detailed) > MOST_DETAILED or (detailed and self._bytes > MOST_BYTES):
            over = next((trial for trial in detailed if trial.ended), detailed[0])
            self._drop_events(over)
            detailed.remove(over)

    def _drop_events(self, trial: _LoggedTrial) -> None:
        trial.detailed = False
        self._bytes -= trial.events.size
        trial.events.clear()


def _row(trial_id: str, trial: _LoggedTrial) -> TrialView:
    counts = trial.counts
    outcome = counts.outcome
    if not trial.ended:
        kept = KEPT if trial.told and not trial.told.running else ''
        outcome = trial.missing or kept or outcome
    return {
        'id': trial_id,
        'robot': trial.robot,
        'experiment': counts.experiment,
        'start': counts.start_time,
        'end': counts.start_time + counts.duration_s,
        'ending': counts.ending.value if trial.ended else '',
        'outcome': outcome,
        'oracle': has_oracle(counts),
        'failures': counts.failures,
        'recoveries': counts.recoveries,
        'questions': counts.questions,
        'answered': counts.answered,
        'lost': _unheard(trial),
        'nth': trial.told.nth if trial.told else 0,
        'detailed': trial.detailed,
    }


def _unheard(trial: _LoggedTrial) -> int:
    """Return how many of its events the console has not heard."""
    told = trial.told.last_seq + 1 if trial.told else 0
    return trial.heard.lost_events + max(0, told - (trial.last_seq + 1))
