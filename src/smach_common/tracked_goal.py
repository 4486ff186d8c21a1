"""One goal on its way: what its server has told of it, and what of that is overdue."""

import time
from typing import Optional

import actionlib
import genpy
from actionlib import CommState

from .action_topics import ActionTopics

# a goal is in these before its server has said a word
_UNHEARD = (CommState.WAITING_FOR_GOAL_ACK, CommState.WAITING_FOR_CANCEL_ACK)


class TrackedGoal:
    """Follows one goal. Subclasses take its transitions and its feedback."""

    def __init__(self, acknowledged_within_s: float, result_within_s: float) -> None:
        """
        :param acknowledged_within_s: a goal that nobody has acknowledged by then was lost.
        :param result_within_s: so was the result of one that has ended so long ago.
        """
        self.handle: Optional[actionlib.ClientGoalHandle] = None
        self._acknowledged_within_s = acknowledged_within_s
        self._result_within_s = result_within_s
        self._sent_s = time.monotonic()
        self._acknowledged = False
        self._ended_s: Optional[float] = None

    def send_on(self, topics: ActionTopics, goal: genpy.Message) -> None:
        """Send it. The caller has seen that a server is there."""
        self._sent_s = time.monotonic()
        # actionlib follows a goal only as long as somebody holds its handle
        self.handle = topics.send_goal(goal, self.on_transition, self.on_feedback)

    def lacks_acknowledgement(self, now_s: float) -> bool:
        """Whether the server should have taken notice of it by now, and has not."""
        return not self._acknowledged and now_s - self._sent_s > self._acknowledged_within_s

    def lacks_result(self, now_s: float) -> bool:
        """Whether it has ended, and its result should have come by now."""
        return self._ended_s is not None and now_s - self._ended_s > self._result_within_s

    def on_transition(self, handle: actionlib.ClientGoalHandle) -> None:
        """Take a transition. This is actionlib's callback."""
        state = handle.get_comm_state()
        self._acknowledged = self._acknowledged or state not in _UNHEARD
        if state == CommState.WAITING_FOR_RESULT:
            self._ended_s = time.monotonic()
        self.take_state(state, handle)

    def on_feedback(self, handle: actionlib.ClientGoalHandle, feedback: genpy.Message) -> None:
        """Take feedback. This is actionlib's callback."""

    def take_state(self, state: int, handle: actionlib.ClientGoalHandle) -> None:
        """Take note of one of the states of `actionlib.CommState`."""
