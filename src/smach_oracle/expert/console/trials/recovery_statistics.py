"""How often going to a state helped after a failure: learned from the events that a console sees. Pure."""
from collections import OrderedDict
from typing import Dict, List, NamedTuple, Optional, Tuple

from ...oracle.events import Event, EventKind

_REMEMBERED = 2000  # trials under way
_MOST_SCORES = 20000  # pairs of states
Place = Tuple[str, str, str]  # robot, container path, state


class Score(NamedTuple):
    """Of so many tries, so many helped."""

    helped: int
    tried: int


class HelpScores:
    """A jump after a failure of S to T has helped if S then succeeds, or its container ends well, before S fails
    again."""

    def __init__(self) -> None:
        self._scores: 'OrderedDict[Tuple[Place, str], List[int]]' = OrderedDict()  # the latest at the end
        self._trying: 'OrderedDict[Tuple[str, str], Dict[str, str]]' = OrderedDict()  # trial, path -> S -> T

    def add(self, robot: str, event: Event, failing_end: bool) -> None:
        """Take in one event; `failing_end`: it ends its container or trial, and not well."""
        trying = self._trying.setdefault((event.trial_id, event.path), {})
        if event.kind == EventKind.FAILURE:
            self._settle(robot, event.path, event.state, trying.pop(event.state, None), False)
        elif event.kind == EventKind.SUPERSEDE:
            trying[event.state] = ''  # the jump that follows is where its outcome leads, and no try
        elif event.kind == EventKind.JUMP and trying.pop(event.state, None) is None:
            trying[event.state] = event.target
        elif event.kind == EventKind.TRANSITION:
            self._settle(robot, event.path, event.state, trying.pop(event.state, None), True)
        elif event.kind == EventKind.CONTAINER_END:
            for state, target in trying.items():
                self._settle(robot, event.path, state, target, not failing_end)
            trying.clear()
        if not trying:
            del self._trying[(event.trial_id, event.path)]
        elif len(self._trying) > _REMEMBERED:
            self._trying.popitem(last=False)

    def score(self, place: Place, target: str) -> Score:
        """How often going to `target` has helped when the state of `place` had failed."""
        return Score(*self._scores.get((place, target), (0, 0)))

    def _settle(self, robot: str, path: str, state: str, target: Optional[str], helped: bool) -> None:
        """Count a try, if there was one."""
        if target:
            score = self._scores.setdefault(((robot, path, state), target), [0, 0])
            self._scores.move_to_end(((robot, path, state), target))
            if len(self._scores) > _MOST_SCORES:
                self._scores.popitem(last=False)
            score[0] += helped
            score[1] += 1
