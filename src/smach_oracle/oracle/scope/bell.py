"""What wakes those who wait in a scope."""

import threading
from typing import List


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

    def hush(self) -> None:
        """Forget that it was rung."""
        self._silence.acquire(blocking=False)

    def wait(self, seconds: float) -> None:
        """Wait until it is rung, at most so long."""
        self._silence.acquire(timeout=min(seconds, threading.TIMEOUT_MAX))


class Bells:
    """The bells of all who wait for one thing."""

    __slots__ = ('_lock', '_bells')

    def __init__(self) -> None:
        self._lock = threading.RLock()  # the handler of a signal may come in between
        self._bells: List[Bell] = []

    def ring(self) -> None:
        """Wake them."""
        with self._lock:
            for bell in self._bells:
                bell.ring()

    def add(self, bell: Bell) -> None:
        """Have one more among them."""
        with self._lock:
            self._bells.append(bell)

    def remove(self, bell: Bell) -> None:
        """Have one no more among them."""
        with self._lock:
            self._bells.remove(bell)


class Flag(threading.Event):
    """An event for which a scope can wait."""

    def __init__(self) -> None:
        super().__init__()
        self.bells = Bells()

    def set(self) -> None:
        """Have it come, and wake who waits for it."""
        super().set()
        self.bells.ring()
