"""Turns for leafs that run in threads: one acts at a time, in the order that the model draws."""

import random
import threading
from typing import Any, Dict, List

from .scheduling import draw_turn

HANG_S = 20.0  # nobody waits longer for its turn


class Hang(BaseException):
    """A leaf has waited for its turn for too long; no state's failure."""


class Turns:
    """Grants a turn once every thread waits for one.

    A thread that has begun a Concurrence does not count until all its branches have ended.
    """

    def __init__(self, seed: str) -> None:
        self._chance = random.Random('turns ' + seed)
        self._changed = threading.Condition()
        self._waiting: Dict[str, bool] = {}  # whether it is the turn of that leaf
        self._running = 1
        self._is_over = False

    def wait(self, key: str) -> None:
        """Wait for the turn of the leaf of that path."""
        with self._changed:
            if self._is_over:
                return
            self._waiting[key] = False
            self._running -= 1
            self._grant()
            if not self._changed.wait_for(lambda: self._waiting[key] or self._is_over, HANG_S):
                raise Hang(key)
            self._waiting.pop(key)

    def fork(self, count: int) -> None:
        """The thread at hand begins a Concurrence of so many branches."""
        with self._changed:
            self._running += count - 1

    def branch_ended(self, is_last: bool) -> None:
        """A branch has ended; behind the last one the thread of the Concurrence goes on."""
        with self._changed:
            self._running -= 0 if is_last else 1
            self._grant()

    def end(self) -> None:
        """Let everybody go."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def _grant(self) -> None:
        free: List[Any] = [key for key, granted in self._waiting.items() if not granted]
        if not self._running and free:
            self._waiting[draw_turn(self._chance, free)] = True
            self._running += 1
            self._changed.notify_all()
