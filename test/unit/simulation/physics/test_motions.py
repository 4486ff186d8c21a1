"""What the controllers do: arrive, stall, or stop and say why."""

import math

import numpy as np
import pytest
from worlds import CAN, TABLE, empty, scene

from smach_oracle.geometry.depth import pixels_of
from smach_oracle.geometry.transforms import from_rpy, inverse
from smach_oracle.pr2.robot import ARM_JOINTS, CAMERA_FRAME, RobotError
from smach_oracle.simulation.physics.camera import INTRINSICS
from smach_oracle.simulation.physics.motions import GripperMotion, TorsoMotion
from smach_oracle.simulation.physics.trajectory import Trajectory
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import Body, RobotStart

RIGHT = ARM_JOINTS['right']
AHEAD = RobotStart(tuple((name, 0.0) for name in RIGHT[:6]))  # the arm is stretched out
WALL = Body('wall', 'box', (0.05, 1.0, 2.0), (0.0, 0.0, 0.0))


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


@pytest.fixture
def robot(world):
    world.reset(empty())
    return DirectRobot(world)


def arm(world):
    return np.array([world.joints()[name] for name in RIGHT])


def test_a_trajectory_is_followed_through_its_points(world, robot):
    start = arm(world)
    points = start + np.array(
        [[0.3, 0.2, 0.1, 0.4, -0.5, -0.3, 0.5], [0.1, 0.4, 0.3, 0.2, -0.2, -0.1, 1.0]]
    )
    motion, seen, begun = Trajectory(RIGHT, points, np.array([1.0, 2.0])), [], world.time
    while motion.tick(world) is None:
        world.step()
        seen.append(arm(world))
    assert np.abs(arm(world) - points[1]).max() < 5e-3
    # corners are rounded off a little
    assert min(np.abs(each - points[0]).max() for each in seen) < 0.03
    assert world.time - begun < 2.4
    steps = np.diff(seen, axis=0) * 60
    assert np.abs(np.diff(steps, axis=0)).max() * 60 < 15  # rad/s2: nothing jerks


def test_velocities_make_it_smooth(world, robot):
    start, way = arm(world), 0.6
    motion, seen = (
        Trajectory([RIGHT[0]], np.array([[start[0] + way]]), np.array([2.0]), np.array([[0.0]])),
        [],
    )
    while motion.tick(world) is None:
        world.step()
        seen.append(arm(world)[0] - start[0])
    share = np.arange(1, 121) / 120
    assert np.abs(np.array(seen[:120]) - way * share**2 * (3 - 2 * share)).max() < 5e-3


def test_a_continuous_joint_goes_the_short_way(world, robot):
    before = world.joints()[RIGHT[6]]
    robot.follow([RIGHT[6]], np.array([[before + 2 * math.pi + 0.3]]), np.array([0.5]))
    assert world.joints()[RIGHT[6]] == pytest.approx(before + 0.3, abs=5e-3)


def test_a_first_point_at_time_zero_is_where_it_is(world, robot):
    start = arm(world)
    robot.follow(RIGHT, np.array([start, start + 0.1]), np.array([0.0, 0.5]))
    assert np.abs(arm(world) - start - 0.1).max() < 5e-3


@pytest.mark.parametrize(
    'joints, positions, times, text',
    [
        ([], [[]], [1.0], 'at least one'),
        ([RIGHT[0], RIGHT[0]], [[-1.0, -1.0]], [1.0], 'none twice'),
        ([RIGHT[0]], [[-1.0, 0.0]], [1.0], 'do not fit to 1 joints'),
        ([RIGHT[0]], [[-1.0], [-1.1]], [1.0, 1.0], 'not increasing'),
        ([RIGHT[0]], [[math.nan]], [1.0], 'not finite'),
        (['r_elbow_joint'], [[0.0]], [1.0], "no controller for joint 'r_elbow_joint'"),
        (['r_gripper_l_finger_joint'], [[0.0]], [1.0], 'no controller'),
        (['base_x'], [[0.0]], [1.0], 'no controller'),
        ([RIGHT[3]], [[0.5]], [9.0], 'r_elbow_flex_joint cannot be at 0.5; allowed: -2.321 to 0'),
        (
            [RIGHT[3]],
            [[-0.1]],
            [0.1],
            'r_elbow_flex_joint would go 1.4 in 0.1 s; its limit is 3.3/s',
        ),
    ],
)
def test_a_trajectory_that_cannot_be_followed_is_refused(
    robot, world, joints, positions, times, text
):
    before, time = arm(world), world.time
    with pytest.raises(RobotError, match=text):
        robot.follow(joints, np.array(positions), np.array(times))
    assert world.time == time and np.array_equal(arm(world), before)


def test_a_trajectory_that_would_pass_a_point_too_fast_is_refused(world, robot):
    motion = Trajectory(
        RIGHT[:1], np.array([[-1.0], [-1.1]]), np.array([2.0, 4.0]), np.array([[1e300], [0.0]])
    )
    assert 'r_shoulder_pan_joint would pass a point at 1e+300/s' in motion.refusal(world)


def test_an_arm_that_meets_a_wall_stops_and_says_so(world):
    wall = Body('wall', 'box', (1.0, 0.05, 2.0), (0.8, -0.75, 0.9))
    ahead = (0.0, 0.0, -1.5, -0.1, 0.5, -0.6, 0.0)
    world.reset(scene(wall, robot=RobotStart(tuple(zip(RIGHT, ahead)))))
    robot, into = DirectRobot(world), arm(world)
    into[0] = -1.6
    with pytest.raises(
        RobotError, match=r'r_\w+ is \d.\d\d off its path after \d.\d s: something is in its way'
    ):
        robot.follow(RIGHT, into[None], np.array([3.0]))
    assert 'robot' in {contact.other for contact in world.contacts('wall')}
    assert arm(world)[0] > -1.3
    held = arm(world)
    world.step(60)
    assert np.abs(arm(world) - held).max() < 0.1  # it holds where it was


def test_a_gripper_closes_opens_and_stalls(world):
    between = CAN._replace(position=(0.75, -0.188, 1.0), mass=0.0)
    world.reset(empty(robot=AHEAD))
    tool = world.tool_pose('right')[:3, 3]
    robot = DirectRobot(world)
    closed = robot.gripper('right', 0.0)
    assert closed.reached and not closed.stalled and closed.position == pytest.approx(0.0, abs=1e-3)
    half = robot.gripper('right', 0.05)
    assert half.reached and half.position == pytest.approx(0.05, abs=1e-3)
    world.reset(scene(between._replace(position=tuple(tool)), robot=AHEAD))
    held = DirectRobot(world).gripper('right', 0.0, 15.0)
    assert held.stalled and not held.reached and held.position == pytest.approx(0.062, abs=2e-3)
    assert held.effort == pytest.approx(15.0, abs=1.0) and world.holding('can') == 'right'
    assert world.gap('left') == pytest.approx(0.09, abs=1e-3)


def test_a_hand_that_closes_again_does_not_loosen_what_it_holds(world):
    world.reset(empty(robot=AHEAD))
    tool = world.tool_pose('right')
    aside = CAN._replace(position=tuple((tool @ [0.0, 0.002, 0.0, 1.0])[:3]), mass=0.0)
    world.reset(scene(aside, robot=AHEAD))
    assert (
        DirectRobot(world).gripper('right', 0.0, 15.0).stalled and world.holding('can') == 'right'
    )
    again, forces = GripperMotion('right', 0.0, 15.0), []
    while again.tick(world) is None:
        world.step()
        forces.append(world.robot.finger_force('right'))
    assert len(forces) > 10 and min(forces) > 14.0


def test_a_gripper_that_does_not_come_to_rest_ends_all_the_same(world, robot, monkeypatch):
    gaps = iter([0.030, 0.031] * 1000)
    monkeypatch.setattr(world, 'gap', lambda arm: next(gaps))
    begun = world.time
    state = robot.gripper('right', 0.0)
    assert state.stalled and not state.reached and world.time - begun < 10.1


@pytest.mark.parametrize(
    'arguments, text',
    [
        (('middle', 0.0), "'middle'; allowed: left, right"),
        (('left', -0.01), 'allowed: 0 to 0.09 m'),
        (('left', math.nan), 'nan m'),
        (('left', 0.0, 0.0), '0.0 N'),
    ],
)
def test_a_gripper_refuses_what_cannot_be(robot, arguments, text):
    with pytest.raises(RobotError, match=text):
        robot.gripper(*arguments)


def test_the_torso_takes_a_real_ones_time(world, robot):
    before = world.time
    robot.torso(0.226)
    assert world.joints()['torso_lift_joint'] == pytest.approx(0.226, abs=2e-3)
    assert world.time - before == pytest.approx(2.0, abs=0.5)
    for height, text in ((0.5, 'allowed: 0 to 0.31'), (math.nan, 'height is nan')):
        with pytest.raises(RobotError, match=text):
            robot.torso(height)
    assert TorsoMotion(world, 0.2).events() == ['torso']


@pytest.mark.parametrize('point', [(0.7, -0.3, 0.7), (1.5, 1.0, 1.2), (0.6, 0.0, 0.0)])
def test_the_camera_looks_at_the_point(world, robot, point):
    robot.look_at(point)
    base_from_camera = inverse(world.true_base()) @ world.link_pose(CAMERA_FRAME)
    column, row, depth = pixels_of(np.array([point]), INTRINSICS, base_from_camera)[0]
    assert depth > 0 and abs(column - INTRINSICS[0, 2]) < 3 and abs(row - INTRINSICS[1, 2]) < 3


@pytest.mark.parametrize(
    'point, text',
    [
        ((1.0, 0.0, 4.0), 'head_tilt_joint cannot be at'),
        ((0.5, math.nan, 1.0), 'finite'),
        ((0.5, 1.0), 'three'),
    ],
)
def test_the_head_refuses_where_it_cannot_look(robot, point, text):
    with pytest.raises(RobotError, match=text):
        robot.look_at(point)


def test_the_base_drives_straight_to_its_goal(world, robot):
    goal = from_rpy((0.5, -0.3, 0.0), yaw=0.8)
    robot.drive(goal)
    assert np.abs(world.true_base() - goal).max() < 5e-3
    with pytest.raises(RobotError, match='finite 4x4'):
        robot.drive(np.full((4, 4), np.nan))


def test_a_base_that_meets_a_wall_says_so(world):
    world.reset(scene(WALL._replace(position=(0.7, 0.0, 1.0))))
    with pytest.raises(RobotError, match='base is .* off its way'):
        DirectRobot(world).drive(from_rpy((0.6, 0.0, 0.0)))
    assert world.true_base()[0, 3] < 0.4


def test_the_base_pushes_what_is_light(world):
    world.reset(scene(TABLE._replace(mass=5.0, size=(0.3, 0.3, 0.3), position=(0.8, 0.0, 0.15))))
    DirectRobot(world).drive(from_rpy((0.5, 0.0, 0.0)))
    assert world.body_pose('table')[0, 3] > 0.9
