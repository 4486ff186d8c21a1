"""Commands as they come in, each with the time at which it came."""
import threading
import time
from collections import deque
from typing import Any, Deque, List, NamedTuple

_MOST = 100  # commands that wait; the oldest are lost


class Arrived(NamedTuple):
    """A command, and when it came: one that has waited is no sign of a hand that still holds."""

    command: Any
    at_s: float  # monotonic


class CommandInbox:
    """Filled by one thread, emptied by another."""

    def __init__(self) -> None:
        self._filled = threading.Condition()
        self._waiting: Deque[Arrived] = deque(maxlen=_MOST)

    def put(self, command: Any) -> None:
        """One more."""
        with self._filled:
            self._waiting.append(Arrived(command, time.monotonic()))
            self._filled.notify()

    def take_all(self, timeout_s: float) -> List[Arrived]:
        """All that have come, the oldest first; none where none comes within the time."""
        with self._filled:
            self._filled.wait_for(lambda: self._waiting, timeout_s)
            found = list(self._waiting)
            self._waiting.clear()
        return found
