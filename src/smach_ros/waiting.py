"""Waiting that a preempt, a message or a shutdown can end at once, on monotonic wall time."""

import threading
import time
from typing import Any, Callable, Optional

import rospy

import smach

SHUTDOWN_CHECK_S = 0.1
"""A shutdown tells nobody: sleepers look for it this often. Everything else wakes them at once."""


def shutting_down() -> bool:
    """Whether rospy, or whatever shutdown check SMACH was given, says that machines should stop.

    True as soon as a shutdown of the node was requested: while its hooks run, a goal can still be
    cancelled.
    """
    return rospy.core.is_shutdown_requested() or bool(smach.is_shutdown())


def seconds(duration: Any) -> Optional[float]:
    """Return a ``rospy.Duration``, a number of seconds or None (no limit), in seconds.

    :raises InvalidStateError: for anything else.
    """
    if duration is None:
        return None
    if hasattr(duration, 'to_sec'):
        return float(duration.to_sec())
    try:
        return float(duration)
    except (TypeError, ValueError) as err:
        raise smach.InvalidStateError(
            '%r is no duration: give a rospy.Duration, a number of seconds or None' % (duration,)
        ) from err


def deadline_after(timeout_s: Optional[float]) -> Optional[float]:
    """Return the monotonic time (s) ``timeout_s`` from now. None stays None."""
    return None if timeout_s is None else time.monotonic() + timeout_s


class Signal(object):
    """Wakes the one thread that executes a state.

    The condition uses a re-entrant lock, so that a signal handler that interrupts the waiting
    thread may notify too.
    """

    def __init__(self) -> None:
        self._condition = threading.Condition()

    def notify(self) -> None:
        """Make the waiting thread look again. Change what it looks at first."""
        with self._condition:
            self._condition.notify_all()

    def wait(
        self,
        happened: Callable[[], bool],
        deadline: Optional[float] = None,
        longest_s: Optional[float] = None,
    ) -> bool:
        """Wait for ``happened()``, a monotonic ``deadline``, ``longest_s`` or a shutdown, and
        return ``happened()``.
        """
        limits = [limit for limit in (deadline, deadline_after(longest_s)) if limit is not None]
        with self._condition:
            while not happened():
                left_s = min(limits) - time.monotonic() if limits else SHUTDOWN_CHECK_S
                if left_s <= 0.0 or shutting_down():
                    return happened()
                self._condition.wait(min(left_s, SHUTDOWN_CHECK_S))
        return True


class Aside(threading.Thread):
    """Runs ``work(stopped)`` at once in a daemon thread, so that the executing thread stays free to
    hear a preempt.

    It also keeps talk with the master out of the main thread: rospy's own handling of Ctrl-C, which
    runs there, waits for the lock of an interrupted call forever. The event ``stopped`` is set by
    ``stop()``. ``ended`` is true once ``value`` or ``error`` is set.
    """

    def __init__(self, name: str, signal: Signal, work: Callable[[threading.Event], Any]) -> None:
        super().__init__(name=name, daemon=True)
        self.ended = False
        self.value: Any = None
        self.error: Optional[Exception] = None
        self._signal = signal
        self._work = work
        self._stopped = threading.Event()
        self.start()

    def stop(self) -> None:
        """Ask the work to end. It does not wait."""
        self._stopped.set()

    def run(self) -> None:
        try:
            self.value = self._work(self._stopped)
        except Exception as err:
            self.error = err
        self.ended = True
        self._signal.notify()
