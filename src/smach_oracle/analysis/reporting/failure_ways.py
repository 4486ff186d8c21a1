"""What followed each kind of failure of a state, and what the oracle decided. Pure."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policy import Action
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.oracle.records.facts import Decider, decided_by
from smach_oracle.oracle.records.way_results import failure_text_key
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..by_state.recoveries import Recoveries
from ..by_state.state_counts import StateCounts, StatesOfTrials, WayCount
from ..replaying.followed import Key, Visits, key_of
from ..trial_counter import TrialCounter, TrialEnding

_ENDED_WELL = {TrialEnding.SUCCESS: True, TrialEnding.FAILURE: False}
_CLASSES = {int(each): each.name for each in FailureClass}


class FailureOf(NamedTuple):
    """A kind of failure of a state."""

    state: str  # path
    reason: str  # kind, outcome, and text without its numbers


class _ByFailure(StatesOfTrials):
    """Counts that are kept for each kind of failure of a state, in the place of each state."""

    def __init__(self) -> None:
        super().__init__()
        self._latest: Dict[str, str] = {}  # reason of the latest failure, by state
        self.counts: Dict[FailureOf, StateCounts] = {}

    def failed(self, name: str, reason: str) -> None:
        self._latest[name] = reason

    def latest(self, name: str) -> FailureOf:
        return FailureOf(name, self._latest.get(name, ''))

    def of(self, name: str) -> StateCounts:
        return self.counts.setdefault(self.latest(name), StateCounts())


@dataclass
class Followed:
    """The sequel of the failures of one kind."""

    failures: int = 0
    decisions: Dict[str, int] = field(default_factory=Counter)
    nothing: int = 0  # no way was gone
    ways: Dict[str, WayCount] = field(default_factory=dict)  # by words

    def decided(self) -> List[Tuple[str, int]]:
        """Return the decisions, the most frequent ones first."""
        return sorted(self.decisions.items(), key=lambda each: (-each[1], each[0]))

    def rows(self) -> List[Tuple[str, WayCount]]:
        """Return the ways, the most frequent ones first, and last that nothing was done."""
        rows = sorted(self.ways.items(), key=lambda each: (-each[1].gone, each[0]))
        left = self.failures - sum(count.gone for count in self.ways.values())
        nothing = [('nothing', WayCount(not_known=self.nothing))] if self.nothing else []
        return rows + nothing or [('not recorded', WayCount(not_known=max(0, left)))]


@dataclass
class FailureWays:
    """What followed failures, and what the oracle decided, in some trials."""

    followed: Dict[FailureOf, Followed] = field(default_factory=dict)
    # by the class of the failure rate, and the decision
    decisions: Dict[Tuple[str, str], int] = field(default_factory=Counter)

    def add(self, other: 'FailureWays') -> None:
        """Add what other trials had."""
        for key, theirs in other.followed.items():
            own = self.followed.setdefault(key, Followed())
            own.failures += theirs.failures
            own.nothing += theirs.nothing
            for action, number in theirs.decisions.items():
                own.decisions[action] = own.decisions.get(action, 0) + number
            for words, count in theirs.ways.items():
                own.ways.setdefault(words, WayCount()).add(count)
        for decision, number in other.decisions.items():
            self.decisions[decision] = self.decisions.get(decision, 0) + number

    def actions(self) -> List[str]:
        """Return the decisions that were made: the known ones in their order, then others."""
        made = {action for _, action in self.decisions}
        known = [each.value for each in Action if each.value in made]
        return known + sorted(made - set(known))

    def classes(self) -> List[str]:
        """Return the classes of failure rates at decisions, LOW first."""
        there = {name for name, _ in self.decisions}
        known = [name for name in _CLASSES.values() if name in there]
        return known + sorted(there - set(known))

    def in_order(self) -> List[Tuple[FailureOf, Followed]]:
        """Return the kinds of failure, the most frequent ones first."""
        return sorted(self.followed.items(), key=lambda each: (-each[1].failures, each[0]))


def failure_ways(events: Iterable[Event], rule: Optional[FailureRule] = None) -> FailureWays:
    """Follow one trial, whose events come in the order of their numbers.

    A way *helped* as it does by state: what differs is that the kinds of failure stand apart.
    """
    found, result = _ByFailure(), FailureWays()
    recoveries, counter = Recoveries(found), TrialCounter(rule)
    now_s = 0.0
    for event in events:
        counter.add(event)
        recoveries.take(event, now_s)
        if event.kind == EventKind.FAILURE and event.failure_kind != FailureKind.INTERRUPTED:
            name = '/'.join(key_of(event))
            reason = failure_text_key(event.failure_kind, event.outcome, event.text)
            found.failed(name, reason)
            recoveries.failed(event)
            result.followed.setdefault(FailureOf(name, reason), Followed()).failures += 1
        elif event.kind == EventKind.DECISION:
            decision = _CLASSES.get(event.failure_class, str(event.failure_class)), event.outcome
            result.decisions[decision] = result.decisions.get(decision, 0) + 1
            failed = found.latest('/'.join(key_of(event)))
            if failed in result.followed and decided_by(event) is not Decider.HELD_BACK:
                decisions = result.followed[failed].decisions
                decisions[event.outcome] = decisions.get(event.outcome, 0) + 1
    recoveries.end(now_s, _ENDED_WELL.get(counter.ending))
    for key, counts in found.counts.items():
        followed = result.followed.setdefault(key, Followed())
        followed.nothing, followed.ways = counts.not_recovered, counts.ways
    return result


@dataclass
class PreconditionCount:
    """The runs of one precondition of a state."""

    met: int = 0
    not_met: int = 0
    # after those that were met: the state's next result
    helped: int = 0
    in_vain: int = 0
    not_known: int = 0

    @property
    def runs(self) -> int:
        """Return how often it was run."""
        return self.met + self.not_met

    def add(self, other: 'PreconditionCount') -> None:
        """Add what other trials had."""
        self.met += other.met
        self.not_met += other.not_met
        self.helped += other.helped
        self.in_vain += other.in_vain
        self.not_known += other.not_known


PreconditionCounts = Dict[Tuple[str, str], PreconditionCount]  # by path of the state, and name


def precondition_counts(events: Iterable[Event]) -> PreconditionCounts:
    """Count the preconditions of one trial, whose events come in the order of their numbers.

    All that were met before a state ran again share its result.
    """
    found: PreconditionCounts = {}
    met: Dict[Key, List[PreconditionCount]] = {}
    visits = Visits()
    for event in events:
        key = key_of(event)
        ends, succeeded = visits.take(event)
        if ends:
            for count in met.pop(key, ()):
                count.helped += succeeded is True
                count.in_vain += succeeded is False
                count.not_known += succeeded is None
        if event.kind == EventKind.PRECONDITION_END:
            name = '/'.join(key), event.target
            count = found.setdefault(name, PreconditionCount())
            if event.outcome == 'met':
                count.met += 1
                met.setdefault(key, []).append(count)
            else:
                count.not_met += 1
        elif event.kind in (EventKind.SUPERSEDE, EventKind.GIVE_UP):
            _not_known(met.pop(key, ()))
    for counts in met.values():
        _not_known(counts)
    return found


def _not_known(counts: Iterable[PreconditionCount]) -> None:
    for count in counts:
        count.not_known += 1


def add_preconditions(
    to: PreconditionCounts, other: Mapping[Tuple[str, str], PreconditionCount]
) -> None:
    """Add what other trials had."""
    for key, count in other.items():
        to.setdefault(key, PreconditionCount()).add(count)
