"""What the robot believes of itself, and is not quite so: encoders, camera, localisation."""

import numpy as np
import pytest
from worlds import empty, scene

from smach_oracle.geometry.transforms import apply, from_rpy, inverse
from smach_oracle.pr2.robot import ARM_JOINTS, CAMERA_FRAME
from smach_oracle.simulation.physics.bodies import SceneBuildError
from smach_oracle.simulation.physics.camera import camera_pose
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import RobotStart

PAN, TILT = 'r_shoulder_pan_joint', 'head_tilt_joint'


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def test_an_arm_goes_by_its_encoders_and_its_hand_ends_elsewhere(world):
    goal = np.array([[-0.4, 0.3, -1.2, -1.4, 0.0, -0.8, 0.0]])
    ends = []
    for error in (0.0, 0.01):
        world.reset(empty(robot=RobotStart(encoder_errors=((PAN, error),))))
        robot = DirectRobot(world)
        robot.follow(ARM_JOINTS['right'], goal, np.array([4.0]))
        world.step(30)
        assert [robot.joints()[name] for name in ARM_JOINTS['right']] == pytest.approx(
            goal[0], abs=2e-3
        )
        ends.append(world.tool_pose('right')[:3, 3])
    # about half a metre from the shoulder's axis
    assert 0.003 < np.linalg.norm(ends[1] - ends[0]) < 0.009


def test_the_image_is_told_to_be_from_where_the_urdf_has_the_camera(world):
    error = (0.005, 0.0, 0.0, 0.0, 0.02, 0.0)
    world.reset(scene(robot=RobotStart(camera_error=error)))
    robot = DirectRobot(world)
    robot.look_at((0.7, 0.0, 0.75))
    image = robot.see()
    nominal = inverse(world.true_base()) @ world.link_pose(CAMERA_FRAME)
    assert np.allclose(image.base_from_camera, nominal, atol=1e-3)
    off = inverse(world.link_pose(CAMERA_FRAME)) @ camera_pose(world)
    assert off[:3, 3] == pytest.approx(error[:3]) and off[0, 2] == pytest.approx(np.sin(0.02))


def test_an_encoder_of_the_head_takes_the_image_elsewhere(world):
    """The camera's axis goes through the point by the encoders, and so misses it."""
    world.reset(scene(robot=RobotStart(encoder_errors=((TILT, 0.02),))))
    robot = DirectRobot(world)
    robot.look_at((0.7, 0.0, 0.75))
    believed = robot.see().base_from_camera
    true = inverse(world.true_base()) @ camera_pose(world)
    assert believed[:3, 2] @ true[:3, 2] == pytest.approx(np.cos(0.02), abs=1e-5)


def test_a_wrong_localisation_stays_over_drives_until_it_is_put_right(world):
    start = RobotStart(base=(0.1, 0.0, 0.3), localisation_error=(0.08, -0.03, 0.02))
    world.reset(empty(robot=start))
    robot, error = DirectRobot(world), from_rpy((0.08, -0.03, 0.0), yaw=0.02)
    for goal in (from_rpy((0.4, 0.1, 0.0), yaw=1.2), from_rpy((0.2, -0.2, 0.0), yaw=-0.4)):
        robot.drive(goal)
        assert np.allclose(robot.odom_from_base(), goal, atol=3e-3)
        assert np.allclose(world.true_base(), inverse(error) @ goal, atol=3e-3)
    robot.localise(world.true_base())
    assert np.allclose(robot.odom_from_base(), world.true_base())
    robot.drive(from_rpy((0.0, 0.3, 0.0)))
    assert apply(world.true_base(), np.zeros(3)) == pytest.approx([0.0, 0.3, 0.0], abs=3e-3)


@pytest.mark.parametrize(
    'start, text',
    [
        (RobotStart(encoder_errors=(('r_wing_joint', 0.1),)), "no joint 'r_wing_joint'"),
        (RobotStart(encoder_errors=((PAN, float('nan')),)), 'robot.encoder_errors is'),
        (RobotStart(localisation_error=(float('inf'), 0.0, 0.0)), 'robot.localisation_error is'),
        (RobotStart(camera_error=(0.0,) * 5 + (float('nan'),)), 'robot.camera_error is'),
    ],
)
def test_errors_that_cannot_be_are_refused(world, start, text):
    with pytest.raises(SceneBuildError, match=text):
        world.reset(empty(robot=start))
