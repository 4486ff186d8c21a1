"""The steps of a robot after an answer, from its oracle/events."""

import queue
import time
from typing import Iterator

from smach_oracle.msg import OracleEvent

from ..robot_topics import RobotTopic

_SHOWN_KINDS = (
    OracleEvent.JUMP,
    OracleEvent.SUPERSEDE,
    OracleEvent.GIVE_UP,
    OracleEvent.INTERFACE_START,
    OracleEvent.WARNING,
    OracleEvent.STATE_START,
    OracleEvent.TRIAL_END,
    OracleEvent.HEALTH_WAIT_START,
    OracleEvent.HEALTH_WAIT_END,
    OracleEvent.HOLD_START,
    OracleEvent.HOLD_END,
    OracleEvent.SENT,
)
_LAST_KINDS = (OracleEvent.STATE_START, OracleEvent.TRIAL_END, OracleEvent.INTERFACE_START)


class NextSteps:
    """Listens from before the answer is sent, so that nothing of what follows is missed."""

    def __init__(self, robot: str, trial_id: str) -> None:
        """`robot`: the node's name. Its events are on <robot>/oracle/events."""
        self._trial_id = trial_id
        self._events: 'queue.Queue[OracleEvent]' = queue.Queue(1000)
        self._listener = RobotTopic(robot, '/oracle/events', OracleEvent, self._take)

    def follow(self, timeout_s: float = 3.0) -> Iterator[OracleEvent]:
        """Yield the events from the answer to the next state that runs.

        At most the time given passes.
        """
        until_s = time.monotonic() + timeout_s
        while time.monotonic() < until_s:
            try:
                event = self._events.get(timeout=max(0.01, until_s - time.monotonic()))
            except queue.Empty:
                return
            yield event
            if event.kind in _LAST_KINDS:
                return

    def forget(self) -> None:
        """Drop what has come so far: the answer is about to be sent."""
        while not self._events.empty():
            self._events.get_nowait()

    def stop(self) -> None:
        """Listen no longer."""
        self._listener.stop()

    def _take(self, event: OracleEvent) -> None:
        ours = event.trial_id == self._trial_id and event.kind in _SHOWN_KINDS
        if ours and not self._events.full():
            self._events.put(event)
