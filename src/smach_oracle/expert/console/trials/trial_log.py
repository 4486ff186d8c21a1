"""The trials that a console has heard of: their events, their counts, and what has helped. Thread-safe, bounded."""
import threading
from collections import OrderedDict
from typing import Any, Dict, List, NamedTuple, Tuple

from ...oracle.events import Event, EventKind
from ...oracle.naming import FailingNames
from .helped import HelpScores, Score
from .tally import Tally, table
from .views import event_view

MOST_TRIALS = 1000
MOST_DETAILED = 60  # of so many trials the events are kept, of the others the counts; those that run come first
MOST_EVENTS = 4000  # of a trial: the first ones
SHOWN_TRIALS = 300
_FAILING = FailingNames()


class _Trial:
    """One trial."""

    def __init__(self, robot: str, first: Event) -> None:
        self.robot = robot
        self.tally = Tally(first)
        self.events: List[Dict[str, Any]] = []
        self.detailed = True  # whether the events are kept


class Slice(NamedTuple):
    """Events of a trial from some position on."""

    start: int
    events: List[Dict[str, Any]]


class TrialLog:
    """Fed by ROS threads, read by the one that serves the pages."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._trials: 'OrderedDict[str, _Trial]' = OrderedDict()
        self._helped = HelpScores()

    def add(self, robot: str, event: Event) -> None:
        """Take in one event of a robot."""
        ended = event.kind in (EventKind.CONTAINER_END, EventKind.TRIAL_END)
        with self._lock:
            trial = self._trials.get(event.trial_id)
            if trial is None:
                trial = self._trials[event.trial_id] = _Trial(robot, event)
                self._forget()
            trial.tally.add(event)
            if trial.detailed and len(trial.events) < MOST_EVENTS:
                trial.events.append(event_view(event))
            self._helped.add(robot, event, ended and (not event.outcome or event.outcome in _FAILING
                                                      or event.outcome.lower() == 'preempted'))

    def end_missing(self, robot: str) -> None:
        """A robot is gone: what still ran there has ended without a word."""
        with self._lock:
            for trial in self._trials.values():
                if trial.robot == robot and not trial.tally.ending:
                    trial.tally.outcome = 'the robot is gone'

    def overview(self) -> Dict[str, Any]:
        """The table of counts and the latest trials, newest first, as plain data."""
        with self._lock:
            trials = [_row(trial_id, trial) for trial_id, trial in list(self._trials.items())[-SHOWN_TRIALS:]]
            return {'table': table(trial.tally for trial in self._trials.values()), 'trials': trials[::-1],
                    'heard': len(self._trials)}

    def events(self, trial_id: str, start: int) -> Slice:
        """The events of a trial from a position on; none where it is not known."""
        with self._lock:
            trial = self._trials.get(trial_id)
            return Slice(start, trial.events[start:] if trial else [])

    def score(self, place: Tuple[str, str, str], target: str) -> Score:
        """How often going to `target` has helped when the state of `place` (robot, path, label) had failed."""
        with self._lock:
            return self._helped.score(place, target)

    def _forget(self) -> None:
        while len(self._trials) > MOST_TRIALS:
            self._trials.popitem(last=False)
        detailed = [trial for trial in self._trials.values() if trial.detailed]
        if len(detailed) > MOST_DETAILED:
            over = next((trial for trial in detailed if trial.tally.ending), detailed[0])
            over.detailed = False
            over.events.clear()


def _row(trial_id: str, trial: _Trial) -> Dict[str, Any]:
    tally = trial.tally
    return {'id': trial_id, 'robot': trial.robot, 'experiment': tally.experiment, 'start': tally.start_s,
            'end': tally.end_s, 'ending': tally.ending, 'outcome': tally.outcome, 'oracle': tally.recovers,
            'failures': tally.failures, 'recoveries': tally.recoveries, 'questions': tally.questions,
            'answered': tally.answered, 'lost': tally.lost, 'detailed': trial.detailed}
