"""Calls functions when they are due, in one daemon thread that lives while one of them waits."""

import threading
from time import monotonic
from typing import Any, Callable, Dict, Optional, Tuple

import smach
from smach_oracle.foreign import repr_of

Ring = Callable[[], None]


class AlarmClock:
    """Calls functions after a time. One serves each tree of containers, from any thread."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._due_s: Dict[Ring, float] = {}  # monotonic
        self._thread: Optional[threading.Thread] = None

    def ring_in(self, seconds: float, ring: Ring) -> None:
        """Call `ring` once, when the time has come. It must return soon.

        What it raises is logged.
        """
        with self._changed:
            self._due_s[ring] = monotonic() + seconds
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._run, name='smach_oracle alarm clock', daemon=True
                )
                self._thread.start()
            else:
                self._changed.notify()

    def forget(self, ring: Ring) -> None:
        """Do not call it any more, where it has not been called yet."""
        with self._changed:
            self._due_s.pop(ring, None)
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                if not self._due_s:
                    self._thread = None
                    return
                ring = min(self._due_s, key=lambda each: self._due_s[each])
                left_s = self._due_s[ring] - monotonic()
                if left_s > 0:
                    self._changed.wait(min(left_s, threading.TIMEOUT_MAX))
                    continue
                del self._due_s[ring]
            _call(ring)

    def __reduce__(self) -> Tuple[Any, ...]:
        """Nothing that waits travels with a copied or pickled machine."""
        return AlarmClock, ()


def _call(ring: Ring) -> None:
    """Call it. The others that wait are called anyway."""
    try:
        ring()
    except Exception as err:
        smach.logerr('an alarm has failed: {}'.format(repr_of(err)))
