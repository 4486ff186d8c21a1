"""Counts what happened in the states of one trial, from its events. Pure."""

from typing import Dict, Iterable, List, NamedTuple, Optional

from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.oracle.records.way_results import failure_text_key
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..replaying.followed import Key, Visits, key_of, left_by
from ..trial_counter import TrialCounter, TrialEnding
from .questions import Questions
from .recoveries import FollowedWay, Recoveries
from .state_counts import Reason, StatesOfTrials

_KINDS = {int(each): each.name.lower() for each in FailureKind}
# each leaves a failed state: the machine goes on
_LEAVES = (EventKind.JUMP, EventKind.GIVE_UP, EventKind.SUPERSEDE)
_ENDED_WELL = {TrialEnding.SUCCESS: True, TrialEnding.FAILURE: False}


class TimedEvent(NamedTuple):
    """An event, and when it came: s since the trial began, without those in which it was down."""

    now_s: float
    event: Event


class FollowedTrial(NamedTuple):
    """What happened in the states of one trial: the counts, and one by one."""

    counts: StatesOfTrials
    failures: List[TimedEvent]  # its FAILURE events that count
    decisions: List[TimedEvent]  # its DECISION events
    ways: List[FollowedWay]  # in the order in which their results were clear


def states_of(events: Iterable[Event], rule: Optional[FailureRule] = None) -> StatesOfTrials:
    """Count the states of one trial, whose events come in the order of their numbers."""
    return follow(events, rule).counts


def follow(events: Iterable[Event], rule: Optional[FailureRule] = None) -> FollowedTrial:
    """Return what happened in the states of one trial. `rule`: as in `load_trials`.

    :param events: in the order of their numbers.
    """
    follower = _Follower(rule)
    for event in events:
        follower.take(event)
    return follower.end()


class _Follower:
    """Follows one trial. Its clock stands still while its program does not run."""

    def __init__(self, rule: Optional[FailureRule]) -> None:
        self._found = StatesOfTrials(trials=1)
        self._counter = TrialCounter(rule)
        self._questions = Questions(self._found)
        self._recoveries = Recoveries(self._found)
        self._visits = Visits()
        self._failures: List[TimedEvent] = []
        self._decisions: List[TimedEvent] = []
        self._now_s = 0.0
        self._wall_s: Optional[float] = None
        self._entered_s: Dict[Key, float] = {}
        self._failing: List[Key] = []  # states that have failed, and not yet succeeded

    def take(self, event: Event) -> None:
        self._go_on(event)
        self._counter.add(event)
        key = key_of(event)
        if event.kind == EventKind.STATE_START:
            self._enter(key)
        elif event.kind in (EventKind.FAILURE, EventKind.TRANSITION):
            self._leave(key)
        ends, succeeded = self._visits.take(event)
        if (ends and succeeded) or event.kind == EventKind.SUPERSEDE:
            self._end_failing([key])
        elif event.kind == EventKind.CONTAINER_END:
            self._end_failing([each for each in self._failing if each[0] == event.path])
        self._recoveries.take(event, self._now_s)
        if event.kind == EventKind.FAILURE and event.failure_kind != FailureKind.INTERRUPTED:
            self._fail(event)
        elif event.kind == EventKind.DECISION:
            self._decisions.append(TimedEvent(self._now_s, event))
        self._questions.take(event, self._now_s, _left_by(event))

    def end(self) -> FollowedTrial:
        for key in list(self._entered_s):
            self._leave(key)
        self._questions.end(self._now_s)
        self._recoveries.end(self._now_s, _ENDED_WELL.get(self._counter.ending))
        self._found.robot_s = self._now_s
        return FollowedTrial(self._found, self._failures, self._decisions, self._recoveries.ways)

    def _go_on(self, event: Event) -> None:
        if self._wall_s is not None and event.kind != EventKind.RESUMED:
            passed_s = max(0.0, event.wall_time - self._wall_s)
            self._now_s += passed_s
            if self._failing:
                self._found.extra_s += passed_s
                for key in self._failing:
                    self._found.of('/'.join(key)).lost_s += passed_s
        self._wall_s = event.wall_time

    def _enter(self, key: Key) -> None:
        self._leave(key)  # of a visit whose end is in no bag
        self._entered_s[key] = self._now_s
        self._found.of('/'.join(key)).visits += 1
        if self._failing:
            self._found.extra_visits += 1
            for each in self._failing:
                self._found.of('/'.join(each)).lost_visits += 1

    def _leave(self, key: Key) -> None:
        since_s = self._entered_s.pop(key, None)
        if since_s is not None:
            self._found.of('/'.join(key)).seconds += self._now_s - since_s

    def _fail(self, event: Event) -> None:
        self._failures.append(TimedEvent(self._now_s, event))
        key, reason = key_of(event), reason_of(event)
        reasons = self._found.of('/'.join(key)).reasons
        reasons[reason] = reasons.get(reason, 0) + 1
        self._recoveries.failed(event)
        if key not in self._failing:
            self._failing.append(key)

    def _end_failing(self, keys: List[Key]) -> None:
        self._failing = [key for key in self._failing if key not in keys]


def reason_of(failure: Event) -> Reason:
    """Return why a state failed: the kind, the outcome, and the text without its numbers."""
    kind = _KINDS.get(failure.failure_kind, str(failure.failure_kind))
    text = failure_text_key(failure.failure_kind, failure.outcome, failure.text)
    return kind, failure.outcome, text


def _left_by(event: Event) -> Optional[Key]:
    return left_by(event) if event.kind in _LEAVES else None
