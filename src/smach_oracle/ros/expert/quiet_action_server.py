"""An action server that tells nothing on closed topics, and takes no goal of a bag."""

import time
from typing import Any

import actionlib
import genpy
import rospy

from smach_common.connections import sender_of

from ..connections import quiet_at_shutdown
from ..log.said_once import warn_once
from ..senders.own_messages import LISTENS_AFTER_S, listens

_LOOK_S = 0.01


class QuietActionServer(actionlib.ActionServer):
    """actionlib's, for a node that goes down while goals are under way.

    actionlib asks `rospy.is_shutdown` before it publishes: rospy has closed the topics by then. Its
    timer and whoever ends a goal would get an error in between.

    A goal counts only if its node listens for the result. The player of a bag does not.
    """

    status_timer: Any  # a rospy.Timer, or None

    def initialize(self) -> None:
        """Begin, with a timer that goes on where simulated time is set back."""
        super().initialize()
        timer = self.status_timer
        if timer is not None:
            timer.shutdown()
            self.status_timer = rospy.Timer(
                rospy.Duration(1.0 / self.status_frequency), self.publish_status_async, reset=True
            )

    def internal_goal_callback(self, ros_goal: genpy.Message) -> None:
        """Take a goal. It runs in the thread of the goal's connection, without a lock."""
        if self._is_awaited(ros_goal):
            super().internal_goal_callback(ros_goal)

    def internal_cancel_callback(self, goal_id: genpy.Message) -> None:
        """Take a request to cancel goals. Of a node that goes down it still cancels its goal."""
        if goal_id.id or self._is_awaited(goal_id):
            super().internal_cancel_callback(goal_id)

    def _is_awaited(self, message: genpy.Message) -> bool:
        node = sender_of(message)
        until_s = time.monotonic() + LISTENS_AFTER_S
        while node and not listens(self.result_pub, node):
            if time.monotonic() > until_s or rospy.is_shutdown():
                warn_once(
                    '{}: ignores each {} of {}, which does not listen for the result. A bag '
                    'that is played does that'.format(
                        rospy.resolve_name(self.ns),
                        'request to cancel' if hasattr(message, 'id') else 'goal',
                        node,
                    )
                )
                return False
            time.sleep(_LOOK_S)
        return True

    def publish_result(self, *args: Any) -> None:
        """Publish the end of a goal."""
        with quiet_at_shutdown():
            super().publish_result(*args)

    def publish_feedback(self, *args: Any) -> None:
        """Publish the feedback of a goal."""
        with quiet_at_shutdown():
            super().publish_feedback(*args)

    def publish_status(self) -> None:
        """Publish the status of every goal."""
        with quiet_at_shutdown():
            super().publish_status()
