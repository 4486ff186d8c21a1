"""Waits of an oracle before it goes on, through a clock that others may hand in."""

import time
from typing import Callable, Protocol

Stopped = Callable[[], bool]
Pause = Callable[[float], object]  # waits so many seconds, or until a preempt

_LOOK_S = 0.05  # how soon a shutdown, or the end of a trial's minutes, is noticed


class Waiting(Protocol):
    """Lets time pass. The machine's thread calls it."""

    def wait(self, seconds: float, what: str, stopped: Stopped, pause: Pause) -> None:
        """Wait so many seconds, or until soon after `stopped()` is true.

        :param what: takes the time, as records of it add it up.
        """


class MonotonicWaiting:
    """Lets monotonic time pass."""

    def wait(self, seconds: float, what: str, stopped: Stopped, pause: Pause) -> None:
        """Wait so many seconds, or until `stopped()` is true."""
        until_s = time.monotonic() + seconds
        while not stopped():
            left_s = until_s - time.monotonic()
            if left_s <= 0:
                return
            pause(min(left_s, _LOOK_S))
