"""Calls functions when they are due, in one daemon thread.

It begins with the first of them. Without any it ends once it would have called one, or at `rest`.
Most are forgotten soon, and the next one comes soon: to wake the thread for each would cost more.
"""

import threading
from typing import Callable, Dict, Optional

import smach
from smach_common.foreign import repr_of

from .clock import Bell, Clock

Ring = Callable[[], None]


class AlarmClock:
    """Calls functions after a time. One serves each tree of containers, from any thread."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._bell = Bell()
        self._due_s: Dict[Ring, float] = {}
        self._wakes_s = 0.0  # when its thread looks again
        self._thread: Optional[threading.Thread] = None

    def ring_in(self, seconds: float, ring: Ring) -> None:
        """Call `ring` once, when the time has come. It must return soon.

        The log says what it raises.
        """
        with self._lock:
            due_s = self._due_s[ring] = self._clock.now() + seconds
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._run, name='smach_oracle alarm clock', daemon=True
                )
                self._thread.start()
            elif due_s < self._wakes_s:
                self._bell.ring()

    def forget(self, ring: Ring) -> None:
        """Do not call it any more, where it has not been called yet."""
        with self._lock:
            self._due_s.pop(ring, None)

    def rest(self) -> None:
        """End the thread if nothing waits."""
        with self._lock:
            if not self._due_s:
                self._bell.ring()

    def _run(self) -> None:
        while True:
            with self._lock:
                if not self._due_s:
                    self._thread = None
                    return
                ring = min(self._due_s, key=lambda each: self._due_s[each])
                left_s = self._due_s[ring] - self._clock.now()
                self._wakes_s = self._due_s[ring]
                is_due = left_s <= 0
                if is_due:
                    del self._due_s[ring]
            if is_due:
                _call(ring)
            else:
                del ring  # it holds a machine, which may go meanwhile
                self._clock.wait(self._bell, left_s, threading.TIMEOUT_MAX, False)


def _call(ring: Ring) -> None:
    """Call it. The others that wait are called anyway."""
    try:
        ring()
    except Exception as err:
        smach.logerr('an alarm has failed: {}'.format(repr_of(err)))
