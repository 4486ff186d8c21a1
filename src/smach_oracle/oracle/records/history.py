"""The chain of visited states of one container (paper, section IV-C). Pure, and without smach.

Every query is O(1), and memory is bounded.

The policies ask two things of the chain: which state without preconditions was visited last before
the present visit (`unconditioned`, the listing's Rs), and which other state succeeded last before
the present state began to fail (`succeeded_before`, the prose). Both are kept up to date as visits
come in, so no walk over the chain is ever needed.
"""

from collections import deque
from itertools import islice
from typing import Any, Callable, Deque, Dict, Iterable, NamedTuple, Optional, Tuple

from ..decision.policy import FailureContext
from .visits import Visit, VisitResult


class _Failed(NamedTuple):
    """A failure of a state.

    `anchor`: the state that a step back leads to while it keeps failing. None means the initial
    state.
    """

    state: Optional[str]  # None where it is not there any more
    successes: int  # of that state in all, when it failed
    anchor: Optional[str]
    anchored: bool  # whether `anchor` was looked up in this execution's chain


class _CountedVisits(Deque[Visit]):
    """Visits, with their number, those that are gone included."""

    added = 0

    def append(self, visit: Visit) -> None:
        super().append(visit)
        self.added += 1

    def clear(self) -> None:
        super().clear()
        self.added = 0

    def copy(self) -> '_CountedVisits':
        twin = super().copy()
        twin.added = self.added
        return twin


# state of the latest visit without preconditions, those of the latest successes, and the latest
# failures, the last one first
Told = Tuple[Any, ...]
_NONE_FAILED = _Failed(None, 0, None, False)
_MOST_FAILURES = 10  # of which experts may take back one after the other
SUCCESS = VisitResult.SUCCESS  # looked up once


class History:
    """Visits of one execution of a container, and its latest failures of the trial.

    `visits`: the latest `length` visits, oldest first. `unconditioned`: state of the latest visit
    that has no preconditions. `succeeded`, `succeeded_other`: the latest successful state, and the
    latest one other than that.
    """

    def __init__(self, length: int) -> None:
        self.visits: Deque[Visit] = deque(maxlen=length)
        self.unconditioned: Optional[str] = None
        self.succeeded: Optional[str] = None
        self.succeeded_other: Optional[str] = None
        self._failures: Deque[_Failed] = deque(maxlen=_MOST_FAILURES)  # oldest first

    def begin_trial(self) -> None:
        """Forget everything."""
        self._failures.clear()
        self.begin_execution()

    def begin_execution(self) -> None:
        """Forget the chain.

        A container may run several times in a trial. Its failures of the trial still count. A state
        that goes on failing gets a new goal for its steps back, from the new chain.
        """
        self.visits.clear()
        self.unconditioned = self.succeeded = self.succeeded_other = None
        if self._failures:
            kept = [each._replace(anchor=None, anchored=False) for each in self._failures]
            self._failures = deque(kept, maxlen=_MOST_FAILURES)

    def resize(self, length: int) -> None:
        """Keep the latest `length` visits from now on."""
        added = self.visits_of_execution
        kind = type(self.visits)
        self.visits = kind(self.visits, maxlen=length)
        if isinstance(self.visits, _CountedVisits):
            self.visits.added = added

    def count_visits(self) -> None:
        """Know from now on how many visits this execution has had, which begins."""
        if not isinstance(self.visits, _CountedVisits):
            self.visits = _CountedVisits(self.visits, maxlen=self.visits.maxlen)

    @property
    def visits_of_execution(self) -> int:
        """Return the number of visits of this execution, where counted, else of those kept."""
        return self.visits.added if isinstance(self.visits, _CountedVisits) else len(self.visits)

    def visited(self, visit: Visit, has_preconditions: bool) -> None:
        """Add a visit that has ended."""
        self.visits.append(visit)
        if not has_preconditions:
            self.unconditioned = visit.state
        if visit.result is SUCCESS and visit.state != self.succeeded:
            self.succeeded_other = self.succeeded
            self.succeeded = visit.state

    def failure_context(self, state: str, initial: str, successes: int) -> FailureContext:
        """Return what the visits say about a failure of `state`. It changes nothing.

        :param initial: the container's initial state.
        :param successes: number of successes of `state` in all.
        """
        return FailureContext(
            state,
            initial,
            self._latest_failure().state == state,
            self.failing_since(state, successes),
            self.unconditioned,
            self.succeeded_before(state, successes),
        )

    def context_since(self, state: str, initial: str, successes: int) -> FailureContext:
        """Return what the visits said about the latest failure of `state`, which is noted."""
        context = self.failure_context(state, initial, successes)
        before = self._latest_failure(1)
        failed_last = context.failed_last and before.state == state
        own = self.failure_of(state)
        if own is not None:
            context = context._replace(succeeded_before=own.anchor)
        return context._replace(
            failed_last=failed_last, failing_since=failed_last and before.successes == successes
        )

    def _latest_failure(self, back: int = 0) -> _Failed:
        """Return the latest failure, or that one before it."""
        return self._failures[-1 - back] if back < len(self._failures) else _NONE_FAILED

    def failure_of(self, state: str) -> Optional[_Failed]:
        return next((each for each in reversed(self._failures) if each.state == state), None)

    def keeps_failing(self, state: str) -> bool:
        """Whether `state` has failed more than once since it succeeded."""
        results = (visit.result for visit in reversed(self.visits) if visit.state == state)
        return [*islice(results, 2)] == [VisitResult.FAILURE] * 2

    def failing_since(self, state: str, successes: int) -> bool:
        """Whether, besides, `state` has not succeeded since.

        `successes`: its number of successes in all.
        """
        latest = self._latest_failure()
        return latest.state == state and latest.successes == successes

    def succeeded_before(self, state: str, successes: int) -> Optional[str]:
        """Return the other state that succeeded last before `state` began to fail.

        The answer stays the same while `state` keeps failing, whatever has succeeded since. It is
        None where nothing had succeeded before.

        :param successes: number of successes of `state` in all.
        """
        latest = self._latest_failure()
        if latest.anchored and self.failing_since(state, successes):
            return latest.anchor
        return self.succeeded if self.succeeded != state else self.succeeded_other

    def failed(self, state: str, successes: int) -> None:
        """Note that `state` failed, before the visit is added.

        A step back keeps its goal while the state keeps failing.
        """
        anchor = self.succeeded_before(state, successes)
        self._failures.append(_Failed(state, successes, anchor, True))

    def supersede(self, state: str, outcome: str, has_preconditions: bool) -> None:
        """Count the latest failure of `state` as neither: an expert did its work."""
        failure = self.failure_of(state)
        if failure is not None:
            self._failures = deque(
                (each for each in self._failures if each is not failure), maxlen=_MOST_FAILURES
            )
        self.count_superseded(state, outcome, has_preconditions)

    def count_superseded(self, state: str, outcome: str, has_preconditions: bool) -> None:
        """Count the latest visit, that of `state`, as one whose work an expert did.

        If another one is the latest, it is added. So it is where a later state has reported the
        failure, and where the program was stopped after the visit.
        """
        visit = Visit(state, outcome, VisitResult.SUPERSEDED)
        if self.visits and self.visits[-1].state == state:
            self.visits[-1] = visit
        else:
            self.visited(visit, has_preconditions)

    def told(self) -> Told:
        """Return all but the visits as plain data, for `take_over`."""
        return (
            self.unconditioned,
            self.succeeded,
            self.succeeded_other,
            *reversed(self._failures),
        )

    def take_over(
        self, visits: Iterable[Visit], number: int, told: Told, has: Callable[[str], bool]
    ) -> None:
        """Go on from another history: its latest visits, their number in all, and what it told.

        `has`: whether a state is still there. Others are forgotten.

        :raises ValueError: where `told` is none of a history.
        """

        def there(label: Any) -> Optional[str]:
            return label if has(label) else None

        try:
            self.unconditioned, self.succeeded, self.succeeded_other = map(there, told[:3])
            failures = [_Failed(*each) for each in reversed(told[3:])]
        except (TypeError, ValueError) as err:
            raise ValueError('that is no history: {}'.format(err)) from err
        self.visits = _CountedVisits(visits, maxlen=self.visits.maxlen)
        self.visits.added = number
        now = (
            each._replace(state=there(each.state), anchor=there(each.anchor)) for each in failures
        )
        self._failures = deque(now, maxlen=_MOST_FAILURES)

    def latest(self) -> Tuple[Visit, ...]:
        """Return the latest visits, oldest first."""
        return tuple(self.visits)

    def __getstate__(self) -> Dict[str, object]:
        """Return copies, each made in one step: another thread may add a visit meanwhile."""
        return {**vars(self), 'visits': self.visits.copy(), '_failures': self._failures.copy()}
