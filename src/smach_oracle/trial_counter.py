"""Count what happened in one trial, one event after the other (definitions: doc/statistics.md).

The one definition for trials in bags, for trials that a robot runs, and for those that a console
follows.
"""

from collections import defaultdict
from enum import Enum
from typing import Any, Callable, ClassVar, Dict, Mapping, Optional, Set, Tuple

from .oracle.records.events import Event, EventKind, FailureKind
from .oracle.records.facts import INPUTS, JUMPED_FROM, ORIGIN, TrialEnd, ended_by, last_stored
from .oracle.settings.failure_rule import FORMER_RULE, EndMeaning, FailureRule, rule_after

AUTONOMOUS_DECISIONS = ('revisit', 'step_back', 'restart')


class TrialEnding(Enum):
    """The way in which a trial ended."""

    SUCCESS = 'success'
    FAILURE = 'failure'
    PREEMPTED = 'preempted'  # by request, or by a shutdown or Ctrl-C
    OTHER = 'other'  # it ended, and nothing says whether that is a success
    UNFINISHED = 'unfinished'  # no end was recorded, it still runs, or is kept to go on later


_ENDINGS = {
    EndMeaning.SUCCESS: TrialEnding.SUCCESS,
    EndMeaning.FAILURE: TrialEnding.FAILURE,
    EndMeaning.PREEMPTED: TrialEnding.PREEMPTED,
    EndMeaning.UNKNOWN: TrialEnding.OTHER,
}


class TrialCounter:
    """The counts of one trial so far. Its events are added in the order of their numbers."""

    def __init__(self, rule: Optional[FailureRule] = None) -> None:
        """`rule`: says which outcomes of the top machine are failures. None: that of its record."""
        self.trial_id = ''
        self.experiment = ''  # path of the top machine
        self.start_time = 0.0  # s since the epoch, the machine's own clock
        self._recoveries = 0
        self.unwell_s = 0.0  # in which it waited until the robot was well
        self._unwell_since_s: Optional[float] = None
        self._rule = rule
        self._recorded_rule = FORMER_RULE
        self.start: Mapping[str, Any] = {}  # data of TRIAL_START
        self._end: Optional[Event] = None
        self._earliest_s = self._latest_s = self._before_s = 0.0
        self.resumed = 0  # how often it went on after its program was stopped
        self.down_s = 0.0  # between its last event, recorded or stored, and that it went on
        self._count = 0
        self._last_seq = -1
        self._left_out = 0  # numbers that no event has, as a resumed trial numbers on
        self._failures: Dict[str, int] = defaultdict(int)
        self._asked: Set[str] = set()
        self._answered: Set[str] = set()
        # by 'PATH/STATE': whether its last decision is a recovery that no jump has carried out yet
        self._decided: Dict[str, bool] = {}
        self._oracle_seen = False
        self._state_seen = False

    @property
    def recovers(self) -> Optional[bool]:
        """Return whether the trial ran with the oracle, as TRIAL_START has it.

        It is True where an oracle was at work.

        None where neither is recorded.
        """
        stated = self.start.get('recovers')
        if isinstance(stated, bool):
            return stated
        return True if self._oracle_seen else None

    @property
    def settings(self) -> Tuple[Tuple[str, Any], ...]:
        """Return the oracle's settings, sorted, or () where they are not recorded."""
        stated = self.start.get('settings')
        return tuple(sorted(stated.items())) if isinstance(stated, Mapping) else ()

    @property
    def origin(self) -> Tuple[Tuple[str, str], ...]:
        """Return where it ran, sorted, or () where that is not recorded."""
        stated = self.start.get(ORIGIN)
        if not isinstance(stated, Mapping):
            return ()
        return tuple(sorted((str(key), str(value)) for key, value in stated.items()))

    @property
    def inputs(self) -> Tuple[Tuple[str, Any], ...]:
        """Return the plain values of the userdata with which it began, sorted.

        It is () where there were none, or where they are not recorded.
        """
        stated = self.start.get(INPUTS)
        return tuple(sorted(stated.items())) if isinstance(stated, Mapping) else ()

    @property
    def duration_s(self) -> float:
        """Return s from the first to the last recorded event.

        During `down_s` of them its program did not run.
        """
        return self._latest_s - self._earliest_s

    @property
    def ending(self) -> TrialEnding:
        """Return how it ended."""
        end = self._end
        if end is None or ended_by(end, self._state_seen) is TrialEnd.KEPT:
            return TrialEnding.UNFINISHED
        if end.outcome:
            return _ENDINGS[self.rule.meaning(end.outcome)]
        # otherwise it ended in an exception
        return TrialEnding.PREEMPTED if self._was_stopped(end) else TrialEnding.FAILURE

    @property
    def rule(self) -> FailureRule:
        """Return the rule that says what its end means.

        It is that of its record. A record of an earlier version names none.
        """
        return self._rule or self._recorded_rule

    @property
    def outcome(self) -> str:
        """Return the top machine's outcome, '' where it raised or is unfinished."""
        return self._end.outcome if self._end is not None else ''

    @property
    def failures(self) -> int:
        """Return how often a state failed."""
        return sum(self._failures.values())

    @property
    def failures_by_state(self) -> Tuple[Tuple[str, int], ...]:
        """Return how often each state failed, by 'PATH/STATE', sorted."""
        return tuple(sorted(self._failures.items()))

    @property
    def recoveries(self) -> int:
        """Return how often the oracle has recovered a state, without the expert."""
        return self._recoveries

    @property
    def questions(self) -> int:
        """Return how many questions were put to the expert."""
        return len(self._asked)

    @property
    def answered(self) -> int:
        """Return how many of these questions were answered."""
        return len(self._asked & self._answered)

    @property
    def last_seq(self) -> int:
        """Return the number of the last event added, or -1 before the first."""
        return self._last_seq

    @property
    def lost_events(self) -> int:
        """Return how many numbers are missing.

        Their events were lost, or came before the first one added.
        """
        return self._last_seq + 1 - self._count - self._left_out

    def add(self, event: Event) -> None:
        """Count one event."""
        kind, seq, wall_time = event.kind, event.seq, event.wall_time
        if not self._count:
            self.trial_id, self.experiment = event.trial_id, _experiment(event)
            self.start_time = self._earliest_s = self._latest_s = wall_time
        if kind == EventKind.RESUMED:
            self._left_out += max(0, seq - 1 - max(last_stored(event), self._last_seq))
        self._before_s = self._latest_s  # that of the events before this one
        self._count += 1
        if seq > self._last_seq:
            self._last_seq = seq
        if wall_time > self._latest_s:
            self._latest_s = wall_time
        elif wall_time < self._earliest_s:
            self._earliest_s = wall_time
        count = self._COUNTS.get(kind)
        if count is not None:
            count(self, event)

    def _count_start(self, event: Event) -> None:
        self.experiment = _experiment(event)
        self.start = event.data if isinstance(event.data, Mapping) else {}
        self._recorded_rule = rule_after(FORMER_RULE, event.data)

    def _count_resumed(self, event: Event) -> None:
        self.resumed += 1
        self._count_down_time(event)
        self._end = None  # it was stopped, and has not ended
        self._recorded_rule = rule_after(self._recorded_rule, event.data)

    def _count_end(self, event: Event) -> None:
        self._end = self._end or event

    def _count_state(self, event: Event) -> None:
        self._state_seen = True

    def _count_failure(self, event: Event) -> None:
        if event.failure_kind != FailureKind.INTERRUPTED:
            self._failures[_state_of(event)] += 1
        self._decided[_state_of(event)] = False

    def _count_question(self, event: Event) -> None:
        self._asked.add(event.query_id)
        self._decided[_state_of(event)] = False

    def _count_answer(self, event: Event) -> None:
        self._answered.add(event.query_id)

    def _count_down_time(self, event: Event) -> None:
        """Count the time from the last event that is known of, until the trial went on.

        The program died in that time, and nobody knows when.
        """
        down_s = event.wall_time - self._before_s
        told = event.data.get('stopped_s') if isinstance(event.data, Mapping) else None
        if isinstance(told, (int, float)):
            down_s = min(down_s, told)
        self.down_s += max(0.0, down_s)

    def _count_wait(self, event: Event) -> None:
        if event.kind == EventKind.HEALTH_WAIT_START:
            self._unwell_since_s = event.wall_time
        elif self._unwell_since_s is not None:
            self.unwell_s += max(0.0, event.wall_time - self._unwell_since_s)
            self._unwell_since_s = None

    # A decision to revisit, step back or start over is counted once it is carried out. The next
    # JUMP from its state does that, or one of a container above that comes from there. A failure of
    # the state or a question about it in between replaces it. Branches of a Concurrence have a path
    # in common, and may decide at the same time.

    def _count_decision(self, event: Event) -> None:
        self._oracle_seen = True
        self._decided[_state_of(event)] = event.outcome in AUTONOMOUS_DECISIONS

    def _count_give_up(self, event: Event) -> None:
        self._decided[_state_of(event)] = False

    def _count_jump(self, event: Event) -> None:
        self._recoveries += self._decided.pop(_state_of(event), False)
        left = event.data.get(JUMPED_FROM, '') if isinstance(event.data, Mapping) else ''
        self._recoveries += self._decided.pop(str(left), False)

    def _was_stopped(self, end: Event) -> bool:
        """Whether a shutdown or Ctrl-C ended it.

        An inconsistent machine has no outcome either, but enters no state.
        """
        return ended_by(end, self._state_seen) in (TrialEnd.STOPPED, TrialEnd.SHUTDOWN)

    # by kind. An event of another kind says no more than that it happened
    _COUNTS: ClassVar[Mapping[int, Callable[['TrialCounter', Event], None]]] = {
        EventKind.TRIAL_START: _count_start,
        EventKind.RESUMED: _count_resumed,
        EventKind.TRIAL_END: _count_end,
        EventKind.STATE_START: _count_state,
        EventKind.FAILURE: _count_failure,
        EventKind.HEALTH_WAIT_START: _count_wait,
        EventKind.HEALTH_WAIT_END: _count_wait,
        EventKind.QUERY_OPENED: _count_question,
        EventKind.QUERY_ANSWERED: _count_answer,
        EventKind.DECISION: _count_decision,
        EventKind.GIVE_UP: _count_give_up,
        EventKind.JUMP: _count_jump,
    }


def _state_of(event: Event) -> str:
    return '{}/{}'.format(event.path, event.state)


def _experiment(event: Event) -> str:
    return event.path.strip('/').split('/')[0]
