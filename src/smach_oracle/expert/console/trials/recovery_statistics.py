"""Counts of how often going to a state helped after a failure, learned from live events. Pure."""

from collections import OrderedDict
from typing import Dict, List, NamedTuple, Optional, Tuple

from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import is_counted

_REMEMBERED = 2000  # trials under way
_MOST_PAIRS = 20000  # pairs of states
FailedState = Tuple[str, str, str]  # robot, container path, state


class RecoveryCounts(NamedTuple):
    """The number of jumps to a state, and of those that helped."""

    helped: int
    tried: int


def takes_out(event: Event) -> bool:
    """Whether it may be an answer that ends a state which still runs: it does not say wait on."""
    return event.kind == EventKind.QUERY_ANSWERED and (event.outcome, event.target) != (
        'goto',
        event.state,
    )


class RecoveryStatistics:
    """Counts the jumps that helped.

    A jump after a failure of S to T has helped if S then succeeds, or its container ends well,
    before S fails again.
    """

    def __init__(self) -> None:
        # the latest at the end
        self._counts: 'OrderedDict[Tuple[FailedState, str], List[int]]' = OrderedDict()
        # trial, path -> S -> T
        self._trying: 'OrderedDict[Tuple[str, str], Dict[str, str]]' = OrderedDict()

    def add(self, robot: str, event: Event, failing_end: bool) -> None:
        """Take in one event. `failing_end`: it ends its container or trial, and not well."""
        trying = self._trying.setdefault((event.trial_id, event.path), {})
        if event.kind == EventKind.FAILURE:
            self._count(robot, event.path, event.state, trying.pop(event.state, None), False)
        elif takes_out(event) and event.state in trying:
            self._count(robot, event.path, event.state, trying.pop(event.state), False)
        elif event.kind == EventKind.SUPERSEDE:
            trying[event.state] = ''  # the jump that follows is where its outcome leads, and no try
        elif event.kind == EventKind.JUMP and trying.pop(event.state, None) is None:
            if 'from' not in (event.data or {}):  # else the failure was in a container below
                trying[event.state] = event.target
        elif event.kind == EventKind.TRANSITION and is_counted(event):
            self._count(robot, event.path, event.state, trying.pop(event.state, None), True)
        elif event.kind == EventKind.CONTAINER_END:
            for state, target in trying.items():
                self._count(robot, event.path, state, target, not failing_end)
            trying.clear()
        if not trying:
            del self._trying[(event.trial_id, event.path)]
        elif len(self._trying) > _REMEMBERED:
            self._trying.popitem(last=False)

    def recovery_counts(self, place: FailedState, target: str) -> RecoveryCounts:
        """Return how often going to `target` has helped when the state of `place` had failed."""
        return RecoveryCounts(*self._counts.get((place, target), (0, 0)))

    def _count(
        self, robot: str, path: str, state: str, target: Optional[str], helped: bool
    ) -> None:
        """Count a try, if there was one."""
        if target:
            counts = self._counts.setdefault(((robot, path, state), target), [0, 0])
            self._counts.move_to_end(((robot, path, state), target))
            if len(self._counts) > _MOST_PAIRS:
                self._counts.popitem(last=False)
            counts[0] += helped
            counts[1] += 1
