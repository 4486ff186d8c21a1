"""Poses of messages in the frame that subsystems think in, and back."""

from typing import Optional, Tuple

import numpy as np
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import (
    apply,
    from_quaternion,
    inverse,
    quaternion,
    transform,
    yaw_of,
)

from ..planning.arm import SkillError
from ..robot import BASE_FRAME, BASE_LINK_HEIGHT, GOAL_FRAMES, ODOM_FRAME, Robot

LARGEST = 1.0  # m, of an object
FARTHEST = 100.0  # m, of any pose


def base_from(frame: str, robot: Robot, what: str) -> np.ndarray:
    """4x4, base_footprint from a frame of a message.

    :param what: the name of the goal's field, for the error.
    :raises SkillError: for a frame that is not allowed.
    """
    name = frame.lstrip('/')
    if name == BASE_FRAME:
        return np.eye(4)
    if name == 'base_link':
        return transform((0.0, 0.0, BASE_LINK_HEIGHT))
    if name == ODOM_FRAME:
        return inverse(robot.odom_from_base())
    raise SkillError('{}: frame {!r}; allowed: {}'.format(what, frame, ', '.join(GOAL_FRAMES)))


def pose_in_base(message: PoseStamped, robot: Robot, what: str) -> np.ndarray:
    """4x4 in base_footprint.

    :raises SkillError: for a frame that is not allowed, or a pose that is not finite.
    """
    position, turn = message.pose.position, message.pose.orientation
    try:
        pose = from_quaternion(
            (position.x, position.y, position.z), (turn.x, turn.y, turn.z, turn.w)
        )
    except ValueError as err:
        raise SkillError('{}: {}'.format(what, err)) from err
    return _near(base_from(message.header.frame_id, robot, what) @ pose, what)


def point_in_base(message: PointStamped, robot: Robot, what: str) -> np.ndarray:
    """(3,) in base_footprint.

    :raises SkillError: as pose_in_base does.
    """
    point = np.array([message.point.x, message.point.y, message.point.z])
    if not np.isfinite(point).all():
        raise SkillError('{}: the point is not finite: {}'.format(what, list(point)))
    return _near(transform(apply(base_from(message.header.frame_id, robot, what), point)), what)[
        :3, 3
    ]


def box_in_base(
    message: PoseStamped, size: Vector3, robot: Robot, what: str, flat: bool = False
) -> UprightBox:
    """An upright box in base_footprint.

    :param flat: its height may be 0, as a table's is.
    :raises SkillError: as pose_in_base does, and for a size that no object has.
    """
    extent = np.array([size.x, size.y, size.z])
    if (
        not np.isfinite(extent).all()
        or extent[:2].min() <= 0
        or extent[2] < 0
        or (extent[2] == 0 and not flat)
    ):
        raise SkillError('{}: its size is {} m; each must be above 0'.format(what, list(extent)))
    if not flat and extent.max() > LARGEST:
        raise SkillError(
            '{}: its size is {} m; at most {} is allowed'.format(what, list(extent), LARGEST)
        )
    pose = pose_in_base(message, robot, what)
    return UprightBox(pose[:3, 3], extent, yaw_of(pose))


def pose_message(pose: np.ndarray, stamp: Optional[object] = None) -> PoseStamped:
    """A 4x4 in base_footprint as a message."""
    header = (
        Header(frame_id=BASE_FRAME) if stamp is None else Header(frame_id=BASE_FRAME, stamp=stamp)
    )
    return PoseStamped(header, Pose(Point(*pose[:3, 3]), Quaternion(*quaternion(pose))))


def box_messages(box: UprightBox, stamp: Optional[object] = None) -> Tuple[PoseStamped, Vector3]:
    """Pose of the centre and extents (m) of a box in base_footprint."""
    return pose_message(box.matrix, stamp), Vector3(*box.size)


def _near(pose: np.ndarray, what: str) -> np.ndarray:
    if np.abs(pose[:3, 3]).max() > FARTHEST:
        raise SkillError(
            '{}: ({}) m is more than {} m away'.format(
                what, ', '.join('{:.6g}'.format(each) for each in pose[:3, 3]), FARTHEST
            )
        )
    return pose
