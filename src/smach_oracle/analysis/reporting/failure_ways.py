"""What followed each kind of failure of a state, and what the oracle decided. Pure."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policy import Action
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import Decider, decided_by
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..by_state.follower import follow, reason_of
from ..by_state.state_counts import WayCount
from ..replaying.followed import Key, Visits, key_of

_CLASSES = {int(each): each.name for each in FailureClass}


class FailureOf(NamedTuple):
    """A kind of failure of a state."""

    state: str  # path
    reason: str  # kind, outcome, and text without its numbers


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

    def of(self, kind: FailureOf) -> Followed:
        """Return the sequel of one kind of failure."""
        return self.followed.setdefault(kind, Followed())

    def add(self, other: 'FailureWays') -> None:
        """Add what other trials had."""
        for key, theirs in other.followed.items():
            own = self.of(key)
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
    trial, result = follow(events, rule), FailureWays()
    kinds = {event.seq: _kind_of(event) for _, event in trial.failures}
    recovered = {way.failure for way in trial.ways}
    for seq, kind in kinds.items():
        followed = result.of(kind)
        followed.failures += 1
        followed.nothing += seq not in recovered
    for way in trial.ways:
        state = '/'.join(way.key)
        kind = FailureOf(state, '') if way.failure is None else kinds[way.failure]
        result.of(kind).ways.setdefault(way.words, WayCount()).note(
            way.helped, way.until_s - way.since_s
        )
    latest: Dict[Key, FailureOf] = {}  # by state
    for _, event in sorted(trial.failures + trial.decisions, key=lambda each: each.event.seq):
        if event.kind == EventKind.FAILURE:
            latest[key_of(event)] = kinds[event.seq]
            continue
        decision = _CLASSES.get(event.failure_class, str(event.failure_class)), event.outcome
        result.decisions[decision] = result.decisions.get(decision, 0) + 1
        failed = latest.get(key_of(event))
        if failed is not None and decided_by(event) is not Decider.HELD_BACK:
            decisions = result.of(failed).decisions
            decisions[event.outcome] = decisions.get(event.outcome, 0) + 1
    return result


def _kind_of(failure: Event) -> FailureOf:
    return FailureOf('/'.join(key_of(failure)), reason_of(failure)[2])


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
