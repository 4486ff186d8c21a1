"""Feedback and results of the controllers' actions."""

from typing import List

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from move_base_msgs.msg import MoveBaseFeedback, MoveBaseResult
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectoryPoint

from control_msgs.msg import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryResult,
    GripperCommandFeedback,
    GripperCommandResult,
    PointHeadFeedback,
    PointHeadResult,
    SingleJointPositionFeedback,
    SingleJointPositionResult,
)
from smach_oracle.geometry.transforms import quaternion
from smach_oracle.pr2.robot import ODOM_FRAME

from ..physics.camera import believed_camera
from ..physics.motions import GripperMotion, HeadMotion, TorsoMotion
from ..physics.trajectory import Motion, Trajectory
from ..physics.world import World
from .motion_table import MotionEnd

CODES = {
    '': FollowJointTrajectoryResult.INVALID_GOAL,
    'path': FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED,
    'goal': FollowJointTrajectoryResult.GOAL_TOLERANCE_VIOLATED,
}


def _header(frame_id: str = '') -> Header:
    return Header(stamp=rospy.get_rostime(), frame_id=frame_id)


def arm(world: World, motion: Trajectory) -> FollowJointTrajectoryFeedback:
    """Return where the joints should be, and where they are."""
    wanted = [world.robot.target(name) for name in motion.joints]
    found = [world.robot.position(name) for name in motion.joints]
    return FollowJointTrajectoryFeedback(
        _header(),
        motion.joints,
        _point(wanted),
        _point(found),
        _point([a - b for a, b in zip(wanted, found)]),
    )


def _point(positions: List[float]) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(positions=positions)


def arm_result(_world: World, _motion: Trajectory, end: MotionEnd) -> FollowJointTrajectoryResult:
    """Return the result, by whether it failed on the way or at its end."""
    if end.result is None or end.result.ok:
        return FollowJointTrajectoryResult(FollowJointTrajectoryResult.SUCCESSFUL, end.text)
    return FollowJointTrajectoryResult(CODES[end.result.missed], end.text)


def gripper(name: str, world: World, _motion: GripperMotion) -> GripperCommandFeedback:
    """Return where the fingers are."""
    return GripperCommandFeedback(world.gap(name), world.robot.finger_force(name), False, False)


def gripper_result(
    name: str, world: World, _motion: GripperMotion, end: MotionEnd
) -> GripperCommandResult:
    """Return where the fingers came to rest."""
    state = end.result.gripper if end.result else None
    if state is None:
        return GripperCommandResult(world.gap(name), world.robot.finger_force(name), False, False)
    return GripperCommandResult(state.position, state.effort, state.stalled, state.reached)


def head(world: World, motion: HeadMotion) -> PointHeadFeedback:
    """The angle that is left."""
    camera = believed_camera(world)
    direction = motion.point - camera[:3, 3]
    cosine = float(direction @ camera[:3, 2]) / max(float(np.linalg.norm(direction)), 1e-9)
    return PointHeadFeedback(float(np.arccos(min(1.0, max(-1.0, cosine)))))


def head_result(_world: World, _motion: HeadMotion, _end: MotionEnd) -> PointHeadResult:
    """Return the result, which has no fields."""
    return PointHeadResult()


def torso(world: World, motion: TorsoMotion) -> SingleJointPositionFeedback:
    """Return how far the torso is."""
    name = motion.joints[0]
    position = world.robot.position(name)
    return SingleJointPositionFeedback(
        _header(), position, world.joint_velocities()[name], motion.height - position
    )


def torso_result(_world: World, _motion: TorsoMotion, _end: MotionEnd) -> SingleJointPositionResult:
    """Return the result, which has no fields."""
    return SingleJointPositionResult()


def base(world: World, _motion: Motion) -> MoveBaseFeedback:
    """Return where the robot believes that it is."""
    pose = world.odom_from_base()
    return MoveBaseFeedback(
        PoseStamped(_header(ODOM_FRAME), Pose(Point(*pose[:3, 3]), Quaternion(*quaternion(pose))))
    )


def base_result(_world: World, _motion: Motion, _end: MotionEnd) -> MoveBaseResult:
    """Return the result, which has no fields."""
    return MoveBaseResult()
