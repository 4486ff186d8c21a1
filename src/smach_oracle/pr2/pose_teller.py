"""Tells a robot's localisation where the robot stands."""

import numpy as np
import rospy
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
)
from std_msgs.msg import Header

from smach_oracle.geometry.transforms import quaternion

from .robot import ODOM_FRAME

TOPIC = 'initialpose'  # where amcl, and RViz's button, have it
SIGMA = (0.01, 0.01)  # m, rad: what a look at the kitchen leaves
TOLD_S = 0.05  # wall s until a robot may have taken it over
# wall s after which it is told again. A pose that comes late would be taken for one from later on
AGAIN_S = 5.0
NEAR = 1e-3  # m or rad between what was told and what the robot believes then


class PoseTeller:
    """Publishes poses on `initialpose`, in the namespace of the node."""

    def __init__(self) -> None:
        self.name = rospy.resolve_name(TOPIC)
        self._poses = rospy.Publisher(TOPIC, PoseWithCovarianceStamped, queue_size=1)

    def has_listener(self) -> bool:
        """Whether anybody gets what is told now."""
        return bool(self._poses.get_num_connections() > 0)

    def tell(self, odom_from_base: np.ndarray) -> None:
        """Tell where the robot stands (4x4, in ODOM_FRAME)."""
        covariance = np.zeros(36)
        covariance[[0, 7]], covariance[35] = SIGMA[0] ** 2, SIGMA[1] ** 2
        pose = Pose(
            Point(*odom_from_base[:3, 3].tolist()), Quaternion(*quaternion(odom_from_base).tolist())
        )
        self._poses.publish(
            PoseWithCovarianceStamped(
                Header(frame_id=ODOM_FRAME), PoseWithCovariance(pose, covariance.tolist())
            )
        )


def told(wanted: np.ndarray, believed: np.ndarray) -> bool:
    """Whether a robot believes to stand where it was told to (both 4x4)."""
    return bool(np.abs(wanted - believed).max() < NEAR)
