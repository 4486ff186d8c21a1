"""The time that the executive goes by, and clocks that pause. What wakes those who wait."""

import contextlib
import threading
import time
from typing import Iterator, Set, Tuple, Type

_LEAST_S = 0.05  # how soon a paused clock is looked at again


class Bell:
    """Wakes the one thread that waits for it.

    It is a bare lock, which is held until somebody rings. A `threading.Event` has a lock of its own
    around its flag: the handler of a signal that preempts a machine, and meets its thread in there,
    would wait for itself.
    """

    def __init__(self) -> None:
        self._silence = threading.Lock()
        self._silence.acquire()

    def ring(self) -> None:
        """Wake who waits for it, or will."""
        try:
            self._silence.release()
        except RuntimeError:
            pass  # it has been rung, and nobody has heard it yet

    def wait(self, seconds: float) -> None:
        """Wait until it is rung, at most so long. Where it was rung before, it does not wait.

        Who waits looks afterwards at what may have changed, and then waits for the next ring.
        """
        self._silence.acquire(timeout=min(seconds, threading.TIMEOUT_MAX))


class Flag:
    """Something that comes once, or that is cleared, and for which a scope can wait."""

    __slots__ = ('bells', '_is_set')

    def __init__(self) -> None:
        self.bells: Set[Bell] = set()
        self._is_set = False

    def is_set(self) -> bool:
        """Whether it has come."""
        return self._is_set

    def set(self) -> None:
        """Have it come, and wake who waits for it."""
        self._is_set = True
        for bell in tuple(self.bells):
            bell.ring()

    def clear(self) -> None:
        """Have it not come yet."""
        self._is_set = False


class Clock:
    """Shows monotonic time, and lets it pass. A test has one of its own."""

    def now(self) -> float:
        """Return monotonic time, in s."""
        return time.monotonic()

    def wait(self, bell: Bell, left_s: float, longest_s: float, is_pause: bool) -> None:
        """Wait until the bell rings, and not beyond the time that is left.

        It may return before. Who waits looks again then.

        :param longest_s: of real time, after which who waits wants to look again.
        :param is_pause: whether nothing but the time is waited for.
        """
        bell.wait(min(left_s, longest_s))


class TreeClock(Clock):
    """The clock of a tree of containers: real time, or that of the clock which a test puts in."""

    def __init__(self, clock: Clock) -> None:
        self.goes_by = clock

    def now(self) -> float:
        return self.goes_by.now()

    def wait(self, bell: Bell, left_s: float, longest_s: float, is_pause: bool) -> None:
        self.goes_by.wait(bell, left_s, longest_s, is_pause)


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

    def __reduce__(self) -> Tuple[Type['PausableClock'], Tuple[Clock]]:
        """Time does not travel with a copied or pickled machine."""
        return PausableClock, (Clock(),)
