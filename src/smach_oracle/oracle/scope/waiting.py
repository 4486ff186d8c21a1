"""Waits of an oracle before it goes on, through a clock that others may hand in."""

from typing import Protocol

from .scope import Scope


class Waiting(Protocol):
    """Lets time pass. The machine's thread calls it."""

    def wait(self, seconds: float, what: str, scope: Scope) -> None:
        """Wait so many seconds, or until `scope` is cancelled.

        :param what: takes the time, as records of it add it up.
        """


class MonotonicWaiting:
    """Lets the time of a scope's own clock pass."""

    def wait(self, seconds: float, what: str, scope: Scope) -> None:
        """Wait so many seconds, or until `scope` is cancelled."""
        scope.wait(seconds)
