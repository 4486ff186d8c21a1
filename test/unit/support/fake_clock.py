"""A clock for tests of the executive, in which only the test has time pass."""

import threading
from typing import List

from smach_oracle.oracle.scope.clock import Bell, Clock

_LOOK_S = 0.05  # of real time, after which who waits looks again


class FakeClock(Clock):
    """A clock for tests, in which only the test has time pass.

    A pause, in which nothing but the time is waited for, is over at once, and the clock shows then
    that its time has passed. A wait for anything else lasts until that comes, or until `advance`
    has brought the clock to its end. No test waits for real seconds so, and none depends on how
    busy the machine is::

        clock = FakeClock()
        scope = Scope(clock=clock)
        scope.wait(300.0)  # returns at once
        assert clock.now() == 1300.0

    :param now_s: the time that it shows at first.
    """

    def __init__(self, now_s: float = 1000.0) -> None:
        self._now_s = now_s
        self._lock = threading.Lock()
        self._bells: List[Bell] = []

    def now(self) -> float:
        """Return the time that it shows, in s."""
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Have so much time pass, and have all that wait look whether their time is over."""
        with self._lock:
            self._now_s += seconds
            for bell in self._bells:
                bell.ring()

    def wait(self, bell: Bell, left_s: float, longest_s: float, is_pause: bool) -> None:
        """Have the time of a pause pass, or wait for the bell."""
        if is_pause:
            self.advance(left_s)
            return
        with self._lock:
            self._bells.append(bell)
        # a test that advances between the look of who waits and this line rings no bell
        bell.wait(min(longest_s, _LOOK_S))
        with self._lock:
            self._bells.remove(bell)
