"""The chain of visited states of one container (paper, IV-C). Pure; no smach. Every query is O(1), memory is bounded.

The policies ask two things of the chain: which state without preconditions was visited last before the present visit
(`unconditioned`, the listing's Rs), and which other state succeeded last before the present state began to fail
(`succeeded_before`, the prose). Both are kept up to date as visits come in, so no walk over the chain is ever needed.
"""
from collections import deque
from typing import Deque, NamedTuple, Optional, Tuple

from .question import Visit, VisitResult


class _Streak(NamedTuple):
    """What continuity is judged by: who failed last, and what a step back goes to while it keeps failing."""

    state: Optional[str]
    successes: int  # of that state in all, when it failed
    anchor: Optional[str]


_NO_STREAK = _Streak(None, 0, None)


class History:
    """Visits of one execution of a container, and the latest failure of the trial.

    `visits`: the latest `length` visits, oldest first. `unconditioned`: state of the latest visit that has no
    preconditions. `succeeded`, `succeeded_other`: the latest successful state, and the latest one other than that.
    """

    def __init__(self, length: int) -> None:
        self.visits: Deque[Visit] = deque(maxlen=length)
        self.unconditioned: Optional[str] = None
        self.succeeded: Optional[str] = None
        self.succeeded_other: Optional[str] = None
        self._streak = _NO_STREAK
        self._before = _NO_STREAK

    def begin_trial(self) -> None:
        """Forget everything."""
        self.begin_execution()
        self._streak = self._before = _NO_STREAK

    def begin_execution(self) -> None:
        """Forget the chain; a container may run several times in a trial, and its failures of the trial still count."""
        self.visits.clear()
        self.unconditioned = self.succeeded = self.succeeded_other = None
        self._streak = self._streak._replace(anchor=None)

    def resize(self, length: int) -> None:
        """Keep the latest `length` visits from now on."""
        self.visits = deque(self.visits, maxlen=length)

    def visited(self, visit: Visit, has_preconditions: bool) -> None:
        """Add a visit that has ended."""
        self.visits.append(visit)
        if not has_preconditions:
            self.unconditioned = visit.state
        if visit.result is VisitResult.SUCCESS and visit.state != self.succeeded:
            self.succeeded_other = self.succeeded
            self.succeeded = visit.state

    def failed_last(self, state: str) -> bool:
        """Whether the most recent failure of this trial was of `state`."""
        return self._streak.state == state

    def failing_since(self, state: str, successes: int) -> bool:
        """Whether, besides, `state` has not succeeded since; `successes`: its number of successes in all."""
        return self._streak.state == state and self._streak.successes == successes

    def succeeded_before(self, state: str) -> Optional[str]:
        """Return the other state that succeeded last before `state` began to fail, None where there is none."""
        if self._streak.state == state and self._streak.anchor is not None:
            return self._streak.anchor
        return self._latest_other(state)

    def failed(self, state: str, successes: int) -> None:
        """Note that `state` failed, before the visit is added; a step back keeps its goal while it keeps failing."""
        going_on = self.failing_since(state, successes)
        anchor = self._streak.anchor if going_on and self._streak.anchor is not None else self._latest_other(state)
        self._before = self._streak
        self._streak = _Streak(state, successes, anchor)

    def supersede(self, outcome: str) -> None:
        """An expert did the work of the latest visit, which failed: it counts as neither success nor failure."""
        self._streak = self._before
        self.visits[-1] = self.visits[-1]._replace(outcome=outcome, result=VisitResult.SUPERSEDED)

    def _latest_other(self, state: str) -> Optional[str]:
        return self.succeeded if self.succeeded != state else self.succeeded_other

    def latest(self) -> Tuple[Visit, ...]:
        """Return the latest visits, oldest first."""
        return tuple(self.visits)
