"""What the controllers make of goals: those that can be followed, and the clear words for those
that cannot.
"""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from rospy import Duration, Time
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_msgs.msg import FollowJointTrajectoryGoal, FollowJointTrajectoryResult, JointTolerance
from smach_oracle.geometry.transforms import from_rpy, yaw_of
from smach_oracle.simulation.node import goals

LIMITS = {'pan': (-1.0, 1.0), 'roll': (-math.inf, math.inf)}
ODOM_FROM_BASE = from_rpy((1.0, 2.0, 0.0), yaw=math.pi / 2)


def trajectory(*points, names=('pan', 'roll'), stamp=0.0, **fields):
    """Each point is (positions, time, further fields...)."""
    made = [
        JointTrajectoryPoint(
            positions=point[0],
            time_from_start=Duration.from_sec(point[1]),
            **(point[2] if len(point) > 2 else {}),
        )
        for point in points
    ]
    return FollowJointTrajectoryGoal(
        trajectory=JointTrajectory(Header(stamp=Time.from_sec(stamp)), list(names), made), **fields
    )


def test_a_trajectory_becomes_arrays_and_tolerances():
    course = goals.checked_trajectory(
        trajectory(
            ([0.1, 0.2], 0.5),
            ([0.3, 9.0], 1.0),
            goal_time_tolerance=Duration(2),
            path_tolerance=[JointTolerance(name='pan', position=0.5)],
            goal_tolerance=[JointTolerance(name='roll', position=-1.0), JointTolerance(name='pan')],
        ),
        LIMITS,
        10.0,
    )
    assert course.joints == ['pan', 'roll']
    assert course.positions.tolist() == [[0.1, 0.2], [0.3, 9.0]]
    assert course.times.tolist() == [0.5, 1.0]
    assert course.velocities is None
    assert course.tolerances == ({'pan': 0.5}, {'roll': math.inf}, 2.0)


def test_velocities_count_where_every_point_has_them():
    rest = {'velocities': [0.0, 0.0]}
    assert goals.checked_trajectory(
        trajectory(([0.1, 0.2], 0.5, rest), ([0.3, 0.0], 1.0, rest)), LIMITS, 0.0
    ).velocities.tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert (
        goals.checked_trajectory(
            trajectory(([0.1, 0.2], 0.5, rest), ([0.3, 0.0], 1.0)), LIMITS, 0.0
        ).velocities
        is None
    )


@pytest.mark.parametrize(
    'goal, code, words',
    [
        (trajectory(names=()), 'INVALID_JOINTS', 'no joint is named'),
        (
            trajectory(([0.0, 0.0], 1.0), names=('pan', 'tilt')),
            'INVALID_JOINTS',
            "'tilt'; allowed: pan, roll",
        ),
        (trajectory(([0.0, 0.0], 1.0), names=('pan', 'pan')), 'INVALID_JOINTS', 'named twice'),
        (trajectory(), 'INVALID_GOAL', 'no points'),
        (trajectory(([0.0], 1.0)), 'INVALID_GOAL', 'point 0 has 1 positions for 2 joints'),
        (trajectory(([float('nan'), 0.0], 1.0)), 'INVALID_GOAL', 'pan cannot be at nan rad'),
        (trajectory(([0.0, float('inf')], 1.0)), 'INVALID_GOAL', 'roll cannot be at inf rad'),
        (
            trajectory(([0.0, 0.0], 1.0), ([1.5, 0.0], 2.0)),
            'INVALID_GOAL',
            'point 1: pan cannot be at 1.5 rad; allowed: -1 to 1',
        ),
        (trajectory(([0.0, 0.0], 1.0), ([0.0, 0.0], 1.0)), 'INVALID_GOAL', 'times must increase'),
        (
            trajectory(([0.0, 0.0], 1e9)),
            'INVALID_GOAL',
            'point 0 is at 1000000000 s; allowed: up to 600 s',
        ),
        (trajectory(([0.0, 0.0], 1.0, {'velocities': [1.0]})), 'INVALID_GOAL', '1 velocities'),
        (
            trajectory(([0.0, 0.0], 1.0, {'velocities': [1.0, float('nan')]})),
            'INVALID_GOAL',
            'finite one for each',
        ),
        (
            trajectory(([0.0, 0.0], 1.0), path_tolerance=[JointTolerance(name='x', position=1.0)]),
            'INVALID_GOAL',
            "path_tolerance: 'x'",
        ),
        (trajectory(([0.0, 0.0], 1.0), stamp=200.0), 'INVALID_GOAL', 'begin 100.00 s from now'),
        (trajectory(([0.0, 0.0], 1.0), stamp=98.0), 'OLD_HEADER_TIMESTAMP', 'ended 1.00 s ago'),
    ],
)
def test_a_bad_trajectory_is_refused_in_words(goal, code, words):
    with pytest.raises(goals.BadGoal, match=words) as caught:
        goals.checked_trajectory(goal, LIMITS, 100.0)
    assert caught.value.code == getattr(FollowJointTrajectoryResult, code)


def test_a_gripper_has_its_gap_and_a_default_effort():
    assert goals.gap_of(0.05, 0.0, 50.0) == (0.05, 50.0)
    assert goals.gap_of(-0.0005, 20.0, 50.0) == (0.0, 20.0)
    for position, effort in ((0.2, 1.0), (float('nan'), 1.0), (0.05, 1e3), (0.05, float('nan'))):
        with pytest.raises(goals.BadGoal, match='allowed'):
            goals.gap_of(position, effort, 50.0)


def test_a_torso_has_its_limits():
    assert goals.height_of(0.2, (0.0, 0.31)) == 0.2
    for height in (0.4, float('nan')):
        with pytest.raises(goals.BadGoal, match='allowed: 0 to 0.31 m'):
            goals.height_of(height, (0.0, 0.31))


@pytest.mark.parametrize(
    'frame, expected',
    [('base_footprint', (1, 0, 1)), ('/base_link', (1, 0, 1.051)), ('odom_combined', (-2, 0, 1))],
)
def test_a_point_is_taken_from_the_frames_that_the_robot_knows(frame, expected):
    point = PointStamped(Header(frame_id=frame), Point(1.0, 0.0, 1.0))
    assert np.allclose(goals.point_in_base(point, ODOM_FROM_BASE), expected)


@pytest.mark.parametrize(
    'frame, x, words',
    [
        ('map', 0.0, "unknown frame 'map'; allowed: base_footprint"),
        ('', 0.0, "unknown frame ''"),
        ('base_link', float('nan'), 'not a finite point'),
        ('base_link', 1e300, 'at most 1000 m away'),
    ],
)
def test_other_points_are_refused(frame, x, words):
    with pytest.raises(goals.BadGoal, match=words):
        goals.point_in_base(
            PointStamped(Header(frame_id=frame), Point(x, 0.0, 0.0)), ODOM_FROM_BASE
        )


def pose(frame='odom_combined', x=1.0, turn=(0.0, 0.0, 0.0, 1.0)):
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, 0.0, 0.0), Quaternion(*turn)))


def test_the_base_is_sent_to_where_odometry_has_the_goal():
    assert np.allclose(goals.odom_from_pose(pose(), ODOM_FROM_BASE), from_rpy((1.0, 0.0, 0.0)))
    ahead = goals.odom_from_pose(pose('base_footprint'), ODOM_FROM_BASE)
    assert np.allclose(ahead[:3, 3], (1.0, 3.0, 0.0)) and yaw_of(ahead) == pytest.approx(
        math.pi / 2
    )


@pytest.mark.parametrize(
    'goal, words',
    [
        (pose('map'), "unknown frame 'map'"),
        (pose(x=float('inf')), 'not finite'),
        (pose(turn=(0.0, 0.0, 0.0, 0.0)), 'target_pose'),
        (pose(turn=(0.5, 0.0, 0.0, 0.5)), 'cannot be tilted'),
        (pose(turn=(1.0, 0.0, 0.0, 1e-9)), 'cannot be tilted'),
        (pose(turn=(0.0, 0.0, 0.0, 1e200)), 'target_pose: .* is no rotation'),
        (pose(x=1e300), r'x 1e\+300, .* allowed: -20 to 20 m'),
    ],
)
def test_a_base_goal_that_cannot_be_is_refused(goal, words):
    with pytest.raises(goals.BadGoal, match=words):
        goals.odom_from_pose(goal, ODOM_FROM_BASE)


def test_only_the_cameras_axis_is_pointed():
    goals.check_axis(Vector3(0.0, 0.0, 0.0), '', ['camera'])
    goals.check_axis(Vector3(0.0, 0.0, 2.0), '/camera', ['camera'])
    for axis, frame in (
        (Vector3(1.0, 0.0, 0.0), ''),
        (Vector3(0.0, 0.0, float('nan')), ''),
        (Vector3(), 'elbow'),
    ):
        with pytest.raises(goals.BadGoal, match='allowed'):
            goals.check_axis(axis, frame, ['camera'])
