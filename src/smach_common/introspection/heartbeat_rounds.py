"""The order in which the heartbeat publishes containers. Pure.

rospy keeps the last `queue_size` messages of what it reads at once, up to 64 kB, and drops the
others. smach_viewer has 50 there. A large tree that goes out at once would be shown in part, always
the same part. So a heartbeat is a round: each container has its turn in it, a few at a time.
"""

import math
from typing import Callable, List, Sequence

HEARTBEAT_S = 2.0
PARTS = 20
"""The least number of parts of a round, where there are as many containers."""
LARGEST_PART = 25
"""Containers that are told of at once: two such parts may be read in one go."""
GREETING_STEP_S = 0.02
"""From part to part where somebody has just begun to listen."""


class HeartbeatRounds(object):
    """Rounds over all containers, each of HEARTBEAT_S, a quick one for newcomers."""

    def __init__(self, list_paths: Callable[[], Sequence[str]]) -> None:
        """
        :param list_paths: the paths there are now. It is asked at the begin of each round.
        """
        self._list_paths = list_paths
        self._left: List[str] = []
        self._size = 1
        self._step_s = HEARTBEAT_S  # of a round that is not quick
        self._is_quick = False
        self._has_newcomer = False
        self._next_s = 0.0

    def greet(self) -> None:
        """Begin a quick round now, or after the quick one that is under way. Any thread."""
        self._has_newcomer = True

    def wait_s(self, now_s: float) -> float:
        """Return the seconds until `due` is to be asked.

        :param now_s: of a monotonic clock.
        """
        return 0.0 if self._must_hurry() else max(0.0, self._next_s - now_s)

    def due(self, now_s: float) -> List[str]:
        """Return the paths whose turn it is. The list is empty before `wait_s` has passed.

        :param now_s: of a monotonic clock.
        """
        if self._must_hurry():
            self._begin(now_s, quick=True)
        elif now_s < self._next_s:
            return []
        elif not self._left:
            self._begin(now_s, quick=False)
        part, self._left = self._left[: self._size], self._left[self._size :]
        if self._is_quick and self._left:
            step_s = GREETING_STEP_S
        else:
            self._is_quick, step_s = False, self._step_s
        self._next_s = max(self._next_s + step_s, now_s)
        return part

    def _must_hurry(self) -> bool:
        return self._has_newcomer and not self._is_quick

    def _begin(self, now_s: float, quick: bool) -> None:
        self._next_s = now_s
        if quick:
            self._has_newcomer = False
        self._is_quick = quick
        self._left = list(self._list_paths())
        count = len(self._left)
        size = max(1, min(LARGEST_PART, math.ceil(count / PARTS)))
        self._step_s = HEARTBEAT_S / max(1, math.ceil(count / size))
        self._size = LARGEST_PART if quick else size
