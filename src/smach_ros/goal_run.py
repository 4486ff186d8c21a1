"""One goal on its way: what the server says of it, told to the state that sent it."""

import time
import traceback
from typing import Any, Optional

from actionlib import CommState
from actionlib_msgs.msg import GoalStatus

import smach
from smach_common.tracked_goal import TrackedGoal
from smach_ros.action_link import ActionLink
from smach_ros.waiting import Signal

UNSEEN_AFTER_S = 5.0
UNSEEN_STATUSES = 5
"""A goal that the server has left out of that many status messages for that long was never
received.
"""
RESULT_AFTER_S = 5.0


class GoalRun(TrackedGoal):
    """Tracks one goal. ``listener`` has SimpleActionState's three overridable callbacks.

    ``done`` turns True once, after ``status`` (a GoalStatus constant) and ``result`` (None if none
    came) are set and the listener was told. Calls from the server after that, or after ``abandon``,
    change nothing.
    """

    def __init__(self, link: ActionLink, listener: Any, signal: Signal) -> None:
        super().__init__(UNSEEN_AFTER_S, RESULT_AFTER_S)
        self.done = False
        self.status = GoalStatus.PENDING
        self.result: Any = None
        self.text = ''  # what the server says about the end, for people
        self._link = link
        self._listener: Optional[Any] = listener
        self._signal = signal
        self._was_active = False
        self._cancelled = False
        self._statuses_before = 0

    def send(self, goal: Any) -> None:
        """Send the goal and begin to track it."""
        topics, watch = self._link.topics, self._link.watch
        if topics is None:
            raise smach.InvalidStateError(
                "Action '%s' is not connected: send_goal() before ready()" % self._link.action_name
            )
        self._statuses_before = watch.status_count if watch is not None else 0
        self.send_on(topics, goal)
        self._link.active_runs.add(self)

    def cancel(self) -> None:
        """Ask the server, once, to stop working on the goal."""
        handle = self.handle
        if handle is None or self.done or self._cancelled:
            return
        self._cancelled = True
        try:
            handle.cancel()
        except Exception as err:
            # rospy raises bare exceptions when a topic is closed under us, as at the end of a
            # shutdown.
            smach.logwarn('Could not cancel the goal: %r' % err)

    def close(self) -> None:
        """Note that the state has what it needs. A shutdown need not cancel this goal any more."""
        self._link.active_runs.discard(self)

    def abandon(self) -> None:
        """Stop tracking the goal. It counts as lost, without a result."""
        self._listener = None
        self.handle = None
        self.status, self.result = GoalStatus.LOST, None

    def problem(self, frozen_after_s: float) -> Optional[str]:
        """Return why the goal will never end, None as long as it may.

        The server is lost, or never took notice of the goal.
        """
        return self._link.problem(frozen_after_s) or self._never_received() or self._result_lost()

    def _never_received(self) -> Optional[str]:
        watch = self._link.watch
        if watch is None or not self.lacks_acknowledgement(time.monotonic()):
            return None
        if watch.status_count - self._statuses_before < UNSEEN_STATUSES:
            return None
        return (
            'its server reports status, but has taken no notice of the goal for %g s'
            % UNSEEN_AFTER_S
        )

    def _result_lost(self) -> Optional[str]:
        if not self.lacks_result(time.monotonic()):
            return None
        return (
            'its server reports the end of the goal, but no result came within %g s'
            % RESULT_AFTER_S
        )

    def take_state(self, state: int, handle: Any) -> None:
        """Tell the listener where the goal has got to."""
        if state in (CommState.ACTIVE, CommState.PREEMPTING) and not self._was_active:
            self._was_active = True
            self._tell('_goal_active_cb')
        elif state == CommState.DONE and not self.done and self._listener is not None:
            self.status, self.result = handle.get_goal_status(), handle.get_result()
            self.text = handle.get_goal_status_text()
            self._tell('_goal_done_cb', self.status, self.result)
            self.done = True
            self._signal.notify()

    def on_feedback(self, handle: Any, feedback: Any) -> None:
        """Tell the listener. This is actionlib's callback."""
        self._tell('_goal_feedback_cb', feedback)

    def _tell(self, callback: str, *values: Any) -> None:
        listener = self._listener
        if listener is None or self.done:
            return
        try:
            getattr(listener, callback)(*values)
        except Exception:
            smach.logerr('%s of %r raised:\n%s' % (callback, listener, traceback.format_exc()))
