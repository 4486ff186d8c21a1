"""Poses in the plane as messages, and back."""

import math
from typing import Tuple

import rospy
from geometry_msgs.msg import Point, Quaternion, Transform, TransformStamped, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from std_msgs.msg import Header

from ..site import Pose, wrapped

MAP, ODOM, BASE, CAMERA = 'map', 'odom', 'base_link', 'camera_optical_frame'


def turn_about_z(yaw: float) -> Quaternion:
    """A turn by `yaw` (rad)."""
    return Quaternion(0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


def pose_message(pose: Pose) -> PoseMessage:
    """The pose on the floor."""
    return PoseMessage(Point(pose[0], pose[1], 0.0), turn_about_z(pose[2]))


def pose_of(message: PoseMessage) -> Pose:
    """The pose in the plane.

    :raises ValueError: where it is not finite, or does not turn about the vertical.
    """
    turn = message.orientation
    values = (message.position.x, message.position.y, turn.x, turn.y, turn.z, turn.w)
    length = math.hypot(turn.z, turn.w)
    if not all(map(math.isfinite, values)) or length < 0.9 or max(abs(turn.x), abs(turn.y)) > 0.1:
        raise ValueError('the pose must be finite, and upright')
    return message.position.x, message.position.y, wrapped(2 * math.atan2(turn.z, turn.w))


def transform(parent: str, child: str, pose: Pose, stamp: rospy.Time) -> TransformStamped:
    """Return the message that says where a frame is in its parent."""
    return TransformStamped(
        Header(stamp=stamp, frame_id=parent),
        child,
        Transform(Vector3(pose[0], pose[1], 0.0), turn_about_z(pose[2])),
    )


def joined(first: Pose, second: Pose) -> Pose:
    """The pose that is at `second` as seen from `first`."""
    cosine, sine = math.cos(first[2]), math.sin(first[2])
    return (
        first[0] + second[0] * cosine - second[1] * sine,
        first[1] + second[0] * sine + second[1] * cosine,
        wrapped(first[2] + second[2]),
    )


def between(pose: Pose, seen_as: Pose) -> Pose:
    """The pose from which `pose` is seen as `seen_as`: joined(between(a, b), b) is a."""
    turn: Tuple[float, float, float] = (0.0, 0.0, wrapped(pose[2] - seen_as[2]))
    moved = joined(turn, seen_as)
    return pose[0] - moved[0], pose[1] - moved[1], turn[2]
