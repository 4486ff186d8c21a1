"""The time that the executive goes by: monotonic time, or that of a test. Clocks that pause."""

import contextlib
import threading
import time
from typing import Any, Iterable, Iterator, List, Protocol, Tuple

from .bell import Bell

_LEAST_S = 0.05  # how soon a paused clock is looked at again


class Clock(Protocol):
    """Shows the time, and lets it pass."""

    def now(self) -> float:
        """Return monotonic time, in s."""

    def wait(self, bell: Bell, left_s: float, longest_s: float, is_pause: bool) -> None:
        """Wait until the bell rings, and not beyond the time that is left.

        It may return before. Who waits looks again then.

        :param longest_s: of real time, after which who waits wants to look again.
        :param is_pause: whether nothing but the time is waited for.
        """


class MonotonicClock:
    """Shows monotonic time."""

    def now(self) -> float:
        """Return monotonic time, in s."""
        return time.monotonic()

    def wait(self, bell: Bell, left_s: float, longest_s: float, is_pause: bool) -> None:
        """Wait until the bell rings, and not beyond the time that is left."""
        bell.wait(min(left_s, longest_s))


class FakeClock:
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
        bell.wait(min(longest_s, _LEAST_S))
        with self._lock:
            self._bells.remove(bell)


class PausableClock:
    """Shows the seconds since it began, except those in which it was paused.

    Several may pause it at once. Safe to use from several threads.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._pauses = 0  # under way
        self.begin()

    def begin(self, at_s: float = 0.0) -> None:
        """Begin to count. Who pauses it goes on to do so.

        :param at_s: what it shows at first.
        """
        with self._lock:
            self._shown_s = at_s
            self._since_s = self._clock.now()

    def now(self) -> float:
        """Return the seconds that it shows."""
        with self._lock:
            return self._count()

    def left_s(self, until_s: float) -> float:
        """Return how long to wait before looking again whether it shows so much, 0.0 once it does.

        While it is paused that is never 0.0.
        """
        with self._lock:
            left_s = max(0.0, until_s - self._count())
            return max(left_s, _LEAST_S) if self._pauses else left_s

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Let its time stand still."""
        self._pause(1)
        try:
            yield
        finally:
            self._pause(-1)

    def _pause(self, more: int) -> None:
        with self._lock:
            self._count()
            self._pauses += more

    def _count(self) -> float:
        now_s = self._clock.now()
        if not self._pauses:
            self._shown_s += now_s - self._since_s
        self._since_s = now_s
        return self._shown_s

    def __reduce__(self) -> Tuple[Any, ...]:
        """Time does not travel with a copied or pickled machine."""
        return PausableClock, (MonotonicClock(),)


@contextlib.contextmanager
def paused(clocks: Iterable[PausableClock]) -> Iterator[None]:
    """Let the time of several clocks stand still."""
    with contextlib.ExitStack() as stack:
        for clock in clocks:
            stack.enter_context(clock.paused())
        yield
