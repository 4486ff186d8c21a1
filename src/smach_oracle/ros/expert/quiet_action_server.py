"""An action server that tells nothing on topics that rospy has closed."""
from typing import Any

import actionlib

from ..connections import quiet_at_shutdown


class QuietActionServer(actionlib.ActionServer):
    """actionlib's, for a node that goes down while goals are under way.

    actionlib asks `rospy.is_shutdown` before it publishes: rospy has closed the topics by then. Its
    timer and whoever ends a goal would get an error in between.
    """

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
