"""A clock for tests, in which no time passes by itself."""

import threading
from typing import Dict

from smach_oracle.oracle.scope.clock import Bell, Clock

_LOOK_S = 0.05  # of real time, after which who waits looks again
_REST_S = 0.005  # of real time, in which others see how late it is
_LONGEST_REST_S = 1.0
_STEP_S = 1.0
_STEPS = 10  # to the next moment that somebody waits for


class StoppedClock(Clock):
    """Time passes where the test, a fault or the oracle has it pass, and takes no real time.

    A pause, in which nothing but the time is waited for, is over at once, and the clock shows then
    that its time has passed. A wait for anything else lasts until that comes, or until somebody
    has brought the clock to its end. So no test waits for real seconds, and none depends on how
    busy the machine is. The states themselves are not held up: one that sleeps does so.

    >>> import smach
    >>> from smach_oracle.testing import Bench, StoppedClock, hang
    >>> wait = smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded', 'preempted'])
    >>> sm = smach.StateMachine(['succeeded', 'preempted'])
    >>> with sm:
    ...     _ = smach.StateMachine.add('WAIT', wait)
    >>> clock = StoppedClock()
    >>> faults = [hang('WAIT', visit=1)]
    >>> with Bench(sm, faults, settings={'time_limit_s': 600.0}, clock=clock) as bench:
    ...     bench.run().assert_recovered('WAIT').outcome
    'succeeded'
    >>> clock.now() >= 600.0
    True

    :param now_s: the time that it shows at first.
    """

    def __init__(self, now_s: float = 0.0) -> None:
        self._now_s = now_s
        self._lock = threading.Lock()
        self._due_s: Dict[Bell, float] = {}  # of who waits

    def now(self) -> float:
        """Return the time that it shows, in s."""
        return self._now_s

    def advance(self, seconds: float) -> None:
        """Have so much time pass, and have all that wait look whether their time is over."""
        with self._lock:
            self._now_s += seconds
            for bell in self._due_s:
                bell.ring()

    def pass_some(self, most_s: float) -> float:
        """Have time pass for somebody who does nothing else. Return how much, in s.

        It takes a moment of real time, in which all those see it that wait for the time.

        :param most_s: no more than that.
        """
        with self._lock:
            next_s = min(self._due_s.values(), default=self._now_s) - self._now_s
        passed_s = min(most_s, max(_STEP_S, next_s / _STEPS))
        self.advance(passed_s)
        rest = threading.Event()
        rested_s = 0.0
        while rested_s < _REST_S or (self._somebody_is_late() and rested_s < _LONGEST_REST_S):
            rest.wait(_REST_S)
            rested_s += _REST_S
        return passed_s

    def _somebody_is_late(self) -> bool:
        with self._lock:
            return any(due_s <= self._now_s for due_s in self._due_s.values())

    def wait(self, bell: Bell, left_s: float, longest_s: float, is_pause: bool) -> None:
        """Have the time of a pause pass, or wait for the bell."""
        if is_pause:
            self.advance(left_s)
            return
        with self._lock:
            self._due_s[bell] = self._now_s + left_s
        # who advances it between the look of who waits and this line rings no bell
        bell.wait(min(longest_s, _LOOK_S))
        with self._lock:
            del self._due_s[bell]
