"""Commands as they come in, each with the time at which it came."""

import threading
import time
from collections import deque
from typing import Deque, List, NamedTuple

from smach_oracle.msg import TeleopCommand

_MOST = 100  # commands that wait. The oldest are lost


class ArrivedCommand(NamedTuple):
    """A command, and when it came.

    One that has waited does not show that its sender still holds.
    """

    command: TeleopCommand
    at_s: float  # monotonic


class CommandInbox:
    """Filled by one thread, emptied by another."""

    def __init__(self) -> None:
        self._filled = threading.Condition()
        self._waiting: Deque[ArrivedCommand] = deque(maxlen=_MOST)

    def put(self, command: TeleopCommand) -> None:
        """Add a command."""
        with self._filled:
            self._waiting.append(ArrivedCommand(command, time.monotonic()))
            self._filled.notify()

    def take_all(self, timeout_s: float) -> List[ArrivedCommand]:
        """All that have come, the oldest first. None where none comes within the time."""
        with self._filled:
            self._filled.wait_for(lambda: self._waiting, timeout_s)
            found = list(self._waiting)
            self._waiting.clear()
        return found
