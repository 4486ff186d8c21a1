"""The meaning of a controller's goal, or why it is refused: messages in, data out, no node."""

import math
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_msgs.msg import FollowJointTrajectoryGoal, FollowJointTrajectoryResult, JointTolerance
from smach_oracle.geometry.transforms import apply, from_quaternion, inverse, transform
from smach_oracle.pr2.robot import BASE_LINK_HEIGHT, GOAL_FRAMES, GRIPPER_OPEN, ODOM_FRAME

from ..physics.trajectory import Tolerances

LEAD_S = 1.0  # a trajectory that is to begin so much later begins at once
LEVEL = 0.02  # rad that a goal of the base may be tilted
MOST_EFFORT = 200.0  # N
LONGEST_S = 600.0  # of a trajectory
FARTHEST = 20.0  # m from the origin of odom_combined that the base may be sent
LOOKS_TO = 1000.0  # m away that a point to look at may be
Limits = Mapping[str, Tuple[float, float]]


class BadGoal(ValueError):
    """A goal that no controller can follow. The text says where it is wrong and what is allowed."""

    def __init__(self, text: str, code: int = FollowJointTrajectoryResult.INVALID_GOAL) -> None:
        super().__init__(text)
        self.code = code  # of FollowJointTrajectoryResult


class CheckedTrajectory(NamedTuple):
    """A joint trajectory, checked."""

    joints: List[str]
    positions: np.ndarray  # (n, joints), rad
    times: np.ndarray  # (n,), s from the start, increasing
    velocities: Optional[np.ndarray]  # (n, joints), rad/s, where every point gives them
    tolerances: Tolerances


def checked_trajectory(
    goal: FollowJointTrajectoryGoal, limits: Limits, now_s: float
) -> CheckedTrajectory:
    """A trajectory for some of the joints that have `limits`.

    :raises BadGoal: naming joint and point.
    """
    joints, positions, times = points_of_trajectory(goal.trajectory, limits)
    start = goal.trajectory.header.stamp.to_sec()
    if start > now_s + LEAD_S:
        raise BadGoal(
            'the trajectory is to begin {:.2f} s from now; allowed: at once (a stamp of 0), or '
            'within '
            '{:g} s'.format(start - now_s, LEAD_S)
        )
    if 0 < start and start + times[-1] < now_s:
        raise BadGoal(
            'the trajectory should have ended {:.2f} s ago'.format(now_s - start - times[-1]),
            FollowJointTrajectoryResult.OLD_HEADER_TIMESTAMP,
        )
    velocities = [point.velocities for point in goal.trajectory.points]
    return CheckedTrajectory(
        joints,
        positions,
        times,
        np.array(velocities) if all(velocities) else None,
        Tolerances(
            _tolerances('path_tolerance', goal.path_tolerance, joints),
            _tolerances('goal_tolerance', goal.goal_tolerance, joints),
            max(0.0, goal.goal_time_tolerance.to_sec()),
        ),
    )


def points_of_trajectory(
    message: JointTrajectory, limits: Limits
) -> Tuple[List[str], np.ndarray, np.ndarray]:
    """Joints, positions (n, joints) and times (n,).

    :raises BadGoal: naming joint and point.
    """
    joints = list(message.joint_names)
    unknown = [name for name in joints if name not in limits]
    if not joints or unknown or len(set(joints)) < len(joints):
        wrong = (
            'no joint is named'
            if not joints
            else (
                'unknown joint {!r}'.format(unknown[0])
                if unknown
                else 'a joint is named twice: ' + ', '.join(joints)
            )
        )
        raise BadGoal(
            '{}; allowed: {}'.format(wrong, ', '.join(limits)),
            FollowJointTrajectoryResult.INVALID_JOINTS,
        )
    if not message.points:
        raise BadGoal('the trajectory has no points')
    before = 0.0
    for number, point in enumerate(message.points):
        before = _check_point(point, 'point {}'.format(number), joints, limits, before)
    return (
        joints,
        np.array([point.positions for point in message.points], float),
        np.array([point.time_from_start.to_sec() for point in message.points]),
    )


def _check_point(
    point: JointTrajectoryPoint, where: str, joints: Sequence[str], limits: Limits, before: float
) -> float:
    """The point's time, s.

    :param before: s, of the point before it.
    :raises BadGoal: naming the point.
    """
    if len(point.positions) != len(joints):
        raise BadGoal(
            '{} has {} positions for {} joints'.format(where, len(point.positions), len(joints))
        )
    for field in ('velocities', 'accelerations'):
        values = getattr(point, field)
        if len(values) not in (0, len(joints)) or not np.isfinite(values).all():
            raise BadGoal(
                '{} has {} {}: {}; allowed: none, or a finite one for each of the {} joints'.format(
                    where, len(values), field, list(values), len(joints)
                )
            )
    for name, position in zip(joints, point.positions):
        lower, upper = limits[name]
        if not lower - 1e-3 <= position <= upper + 1e-3 or math.isinf(position):
            raise BadGoal(
                '{}: {} cannot be at {:.4g} rad; allowed: {:.4g} to {:.4g}'.format(
                    where, name, position, lower, upper
                )
            )
    time_s: float = point.time_from_start.to_sec()
    if time_s <= before and not (where == 'point 0' and time_s == 0):
        raise BadGoal(
            '{} is at {:.3f} s, and the one before it at {:.3f} s; times must increase '
            'from 0'.format(where, time_s, before)
        )
    if time_s > LONGEST_S:
        raise BadGoal('{} is at {:.0f} s; allowed: up to {:g} s'.format(where, time_s, LONGEST_S))
    return time_s


def _tolerances(
    field: str, values: Sequence[JointTolerance], joints: Sequence[str]
) -> Dict[str, float]:
    found = {}
    for value in values:
        if value.name not in joints or math.isnan(value.position):
            raise BadGoal(
                '{}: {!r} with {}; allowed: numbers for the joints of the trajectory, {}'.format(
                    field, value.name, value.position, ', '.join(joints)
                )
            )
        if value.position:
            found[value.name] = value.position if value.position > 0 else math.inf
    return found


def gap_of(position: float, max_effort: float, default_effort: float) -> Tuple[float, float]:
    """m between the finger tips, and N.

    :raises BadGoal: for values that are not allowed.
    """
    if not -0.001 <= position <= GRIPPER_OPEN + 0.001:
        raise BadGoal(
            'position {} m; allowed: 0 to {:g} m between the finger tips'.format(
                position, GRIPPER_OPEN
            )
        )
    if not max_effort <= MOST_EFFORT:
        raise BadGoal(
            'max_effort {} N; allowed: up to {:g} N, 0 or less for the default of {:g} N'.format(
                max_effort, MOST_EFFORT, default_effort
            )
        )
    return min(max(position, 0.0), GRIPPER_OPEN), max_effort if max_effort > 0 else default_effort


def height_of(position: float, limits: Tuple[float, float]) -> float:
    """m, of the torso's joint.

    :raises BadGoal: for a height outside the limits.
    """
    if not limits[0] - 1e-3 <= position <= limits[1] + 1e-3:
        raise BadGoal('position {} m; allowed: {:.4g} to {:.4g} m'.format(position, *limits))
    return min(max(position, limits[0]), limits[1])


def point_in_base(point: PointStamped, odom_from_base: np.ndarray) -> np.ndarray:
    """(3,) m in base_footprint.

    :raises BadGoal: for an unknown frame, or a point that is not finite or too far away.
    """
    where = np.array([point.point.x, point.point.y, point.point.z])
    if not np.isfinite(where).all() or np.abs(where).max() > LOOKS_TO:
        raise BadGoal(
            'target {} is not a finite point at most {:g} m away'.format(where.tolist(), LOOKS_TO)
        )
    return apply(_base_from(point.header, odom_from_base), where)


def odom_from_pose(pose: PoseStamped, odom_from_base: np.ndarray) -> np.ndarray:
    """4x4, where the base should stand in odom_combined.

    :raises BadGoal: for an unknown frame, or a pose that the base cannot have.
    """
    place, turn = pose.pose.position, pose.pose.orientation
    try:
        goal = from_quaternion((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
    except ValueError as err:
        raise BadGoal('target_pose: {}'.format(err)) from err
    if not goal[2, 2] >= math.cos(LEVEL):
        raise BadGoal('target_pose: the base cannot be tilted; only turns about z are allowed')
    found: np.ndarray = odom_from_base @ _base_from(pose.header, odom_from_base) @ goal
    if np.abs(found[:2, 3]).max() > FARTHEST:
        raise BadGoal(
            'target_pose: x {:.3g}, y {:.3g} m in {}; allowed: -{:g} to {:g} m'.format(
                float(found[0, 3]), float(found[1, 3]), ODOM_FRAME, FARTHEST, FARTHEST
            )
        )
    return found


def _base_from(header: Header, odom_from_base: np.ndarray) -> np.ndarray:
    """4x4, base_footprint from the header's frame."""
    frame = header.frame_id.lstrip('/')
    if frame not in GOAL_FRAMES:
        raise BadGoal(
            'unknown frame {!r}; allowed: {}'.format(header.frame_id, ', '.join(GOAL_FRAMES))
        )
    if frame == ODOM_FRAME:
        return inverse(odom_from_base)
    return transform((0.0, 0.0, BASE_LINK_HEIGHT if frame == 'base_link' else 0.0))


def check_axis(axis: Vector3, frame: str, camera_frames: Sequence[str]) -> None:
    """Check that a head's goal points the camera's own axis, z.

    :raises BadGoal: for another frame or axis.
    """
    wanted = np.array([axis.x, axis.y, axis.z])
    if frame and frame.lstrip('/') not in camera_frames:
        raise BadGoal(
            'pointing_frame {!r}; allowed: {}, or none'.format(frame, ', '.join(camera_frames))
        )
    if wanted.any() and not (
        np.isfinite(wanted).all() and np.allclose(wanted[:2], 0.0) and wanted[2] > 0
    ):
        raise BadGoal(
            'pointing_axis {}; allowed: 0 0 1, along which the camera looks, or 0 0 0'.format(
                wanted.tolist()
            )
        )
