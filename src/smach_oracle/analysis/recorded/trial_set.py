"""Trials that were read from bags, for a notebook or a script of your own."""

import math
import os
from typing import (
    TYPE_CHECKING,
    Callable,
    Iterator,
    List,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
    Union,
    overload,
)

from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.records.facts import decided_by
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..bag_events import SkippedBag
from ..by_state.follower import FollowedTrial, follow, reason_of
from ..by_state.recoveries import FollowedWay
from ..counting.trial_summary import TrialSummary
from ..replaying.followed import key_of
from ..trials import events_of, load_trials
from ..variants import variant_names
from .rows import DecisionOnFailure, FailureOfState, StateOfTrial, Table
from .trial_line import TrialLine, trial_lines

if TYPE_CHECKING:
    import pandas


_CLASSES = {int(each): each.name for each in FailureClass if each}


class _Rows(NamedTuple):
    """What happened in some trials, one by one."""

    states: List[StateOfTrial]
    failures: List[FailureOfState]
    decisions: List[DecisionOnFailure]


class TrialSet(Sequence[TrialSummary]):
    """Trials in the order of their beginning, and what happened in them.

    It is a sequence of `TrialSummary`. Its bags are read again, once, where their events are
    needed: for `states`, `failures` and `decisions`.

    `skipped`: bags that could not be used, with the reason.

        >>> from smach_oracle import analysis
        >>> trials = analysis.read('test/data/v0_1')
        >>> len(trials), trials[0].outcome
        (20, 'succeeded')
        >>> failure = trials.failures()[0]
        >>> failure.state, failure.way, failure.helped
        ('PICK_AND_PLACE/DETECT_TABLETOP', 'trying it again', True)
    """

    def __init__(
        self,
        trials: Sequence[TrialSummary],
        skipped: Sequence[SkippedBag] = (),
        rule: Optional[FailureRule] = None,
    ) -> None:
        """`rule`: by which they were counted. None: that of each record."""
        self._trials = tuple(trials)
        self.skipped = tuple(skipped)
        self._rule = rule
        self._rows: Optional[_Rows] = None

    @overload
    def __getitem__(self, index: int) -> TrialSummary: ...

    @overload
    def __getitem__(self, index: slice) -> 'TrialSet': ...

    def __getitem__(self, index: Union[int, slice]) -> Union[TrialSummary, 'TrialSet']:
        """Return a trial, or some trials."""
        if isinstance(index, slice):
            return TrialSet(self._trials[index], self.skipped, self._rule)
        return self._trials[index]

    def __len__(self) -> int:
        return len(self._trials)

    def __iter__(self) -> Iterator[TrialSummary]:
        return iter(self._trials)

    def __repr__(self) -> str:
        return '<{} trials, {} bags skipped>'.format(len(self), len(self.skipped))

    def where(self, is_wanted: Callable[[TrialSummary], object]) -> 'TrialSet':
        """Return those for which a function returns something true."""
        return TrialSet(list(filter(is_wanted, self)), self.skipped, self._rule)

    def lines(self) -> Table[TrialLine]:
        """Return a flat line for each trial: the columns of `bag_statistics --csv`."""
        return Table(TrialLine, trial_lines(self._trials))

    def to_frame(self) -> 'pandas.DataFrame':
        """Return a frame with a line for each trial. Its columns: those of `lines`.

        :raises ImportError: where pandas is missing.
        """
        return self.lines().to_frame()

    def states(self) -> Table[StateOfTrial]:
        """Return a row for each state that was entered, or asked about, in each trial.

        :raises BagError: where a bag cannot be read any more.
        """
        return Table(StateOfTrial, self._followed().states)

    def failures(self) -> Table[FailureOfState]:
        """Return a row for each failure of a state that counts, as `failures` of a trial does.

        :raises BagError: where a bag cannot be read any more.
        """
        return Table(FailureOfState, self._followed().failures)

    def decisions(self) -> Table[DecisionOnFailure]:
        """Return a row for each decision of an oracle.

        :raises BagError: where a bag cannot be read any more.
        """
        return Table(DecisionOnFailure, self._followed().decisions)

    def _followed(self) -> _Rows:
        if self._rows is None:
            names = variant_names(self._trials)
            rows = _Rows([], [], [])
            for trial, events in events_of(self._trials):
                about = (trial.trial_id, trial.experiment, names[trial.trial_id])
                _add_rows(rows, about, follow(events, self._rule))
            self._rows = rows
        return self._rows


def read(*places: str, failing_outcomes: Sequence[str] = ()) -> TrialSet:
    """Read all bags in folders and below. A place may also be a bag.

    :param failing_outcomes: outcomes of a trial that are failures, whole or as a suffix. All others
        are then successes. Without them each trial is counted by the rule of its record.
    :raises BagError: where there is nothing to read: no such folder, no bags, or none with a trial.
    """
    rule = FailureRule(tuple(failing_outcomes)) if failing_outcomes else None
    found = load_trials([os.fspath(place) for place in places], rule)
    return TrialSet(found.trials, found.skipped, rule)


def _add_rows(rows: _Rows, about: Tuple[str, str, str], trial: FollowedTrial) -> None:
    for name, counts in sorted(trial.counts.states.items()):
        rows.states.append(
            StateOfTrial(
                *about,
                name,
                counts.visits,
                counts.failures,
                counts.not_recovered,
                counts.questions,
                counts.seconds,
                counts.lost_s,
                counts.lost_visits,
            )
        )
    # of several ways after one failure, the one that was gone first
    after = {way.failure: way for way in sorted(trial.ways, key=_began, reverse=True)}
    by_decision = {way.decision: way for way in trial.ways}
    for now_s, event in trial.failures:
        kind, outcome, reason = reason_of(event)
        way = after.get(event.seq)
        rows.failures.append(
            FailureOfState(
                *about,
                now_s,
                _state(event),
                kind,
                outcome,
                event.text,
                reason,
                way.words if way else '',
                way.by_expert if way else None,
                way.helped if way else None,
                way.until_s - way.since_s if way else None,
            )
        )
    for now_s, event in trial.decisions:
        way = by_decision.get(event.seq)
        rows.decisions.append(
            DecisionOnFailure(
                *about,
                now_s,
                _state(event),
                event.outcome,
                event.target,
                decided_by(event).value,
                _CLASSES.get(event.failure_class, ''),
                None if math.isnan(event.rate) else event.rate,
                event.text,
                way.words if way else '',
                way.helped if way else None,
                way.until_s - way.since_s if way else None,
            )
        )


def _began(way: FollowedWay) -> float:
    return way.since_s


def _state(event: Event) -> str:
    return '/'.join(key_of(event))
