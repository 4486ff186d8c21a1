"""An event that a signal's handler may set, and a thread that it may start.

Python runs a handler in the main thread, between any two instructions of it. `threading.Event` and
`threading.Thread` take locks that are not re-entrant: where the main thread is inside one of them,
the handler would wait for itself.
"""

import _thread
import threading
from typing import Any, Callable, List, Optional


class Latch:
    """Is set once, and stays so. Any thread may wait for that, or set it, a handler too."""

    def __init__(self) -> None:
        self._is_set = False
        self._waiting: List[Any] = []  # a lock for each thread that waits

    def is_set(self) -> bool:
        """Whether it is set."""
        return self._is_set

    def set(self) -> None:
        """Set it, and wake all that wait."""
        self._is_set = True
        for lock in list(self._waiting):
            try:
                lock.release()
            except RuntimeError:  # a handler that came in between has released it
                pass

    def wait(self, timeout_s: Optional[float] = None) -> bool:
        """Wait until it is set, or so long. Return whether it is set."""
        lock = threading.Lock()
        lock.acquire()
        self._waiting.append(lock)  # before it looks: who sets it from here on releases the lock
        try:
            if not self._is_set:
                lock.acquire(timeout=-1 if timeout_s is None else max(0.0, timeout_s))
        finally:
            self._waiting.remove(lock)
        return self._is_set


def start_thread(function: Callable[[], object]) -> Latch:
    """Call a function in a thread that does not keep the process. Return what its end sets."""
    ended = Latch()

    def call() -> None:
        try:
            function()
        finally:
            ended.set()

    _thread.start_new_thread(call, ())
    return ended
