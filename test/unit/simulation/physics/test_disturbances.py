"""What happens to a world in the course of a trial: once, when its event comes, and no earlier."""

import numpy as np
import pytest
from worlds import scene

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.pr2.robot import RobotError
from smach_oracle.simulation.physics.motions import BaseMotion
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT
from smach_oracle.simulation.scenes.kitchen_scene import draw as draw_kitchen
from smach_oracle.simulation.scenes.scene import Body, Disturbance, Near

IN_VIEW = {
    'l_shoulder_pan_joint': 0.0,
    'l_shoulder_lift_joint': 0.35,
    'l_upper_arm_roll_joint': 0.8,
    'l_elbow_flex_joint': -1.2,
}
LOOK = (0.72, -0.05, 0.75)


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def test_a_pushed_arm_is_in_the_view_when_the_head_has_turned(world):
    pushed = Disturbance('arm', 'look_at', tuple(IN_VIEW.items()))
    world.reset(scene(disturbances=(pushed,)))
    before = world.joints()['l_shoulder_pan_joint']
    world.step(120)
    assert world.joints()['l_shoulder_pan_joint'] == pytest.approx(before, abs=2e-3)
    robot = DirectRobot(world)
    robot.look_at(LOOK)
    assert not world.disturbed
    pushed_to = world.joints()
    for name, position in IN_VIEW.items():
        assert pushed_to[name] == pytest.approx(position, abs=0.1)
    # it stays, for its motors hold it there
    world.step(120)
    assert world.joints() == pytest.approx(pushed_to, abs=0.01)
    # it can be taken out again
    robot.follow(['l_shoulder_pan_joint'], np.array([[before]]), np.array([2.0]))
    robot.look_at(LOOK)
    assert world.joints()['l_shoulder_pan_joint'] == pytest.approx(before, abs=0.02)


def test_an_arm_whose_motors_run_springs_back_when_the_person_lets_go(world):
    pushed = Disturbance('arm', 'torso', tuple(IN_VIEW.items()) + (('motors', 1.0),))
    world.reset(scene(disturbances=(pushed,)))
    before = world.joints()['l_shoulder_pan_joint']
    world.happened('torso')
    world.step(90)
    assert world.joints()['l_shoulder_pan_joint'] < before - 0.3
    DirectRobot(world).torso(0.2)
    world.step(240)
    assert world.joints()['l_shoulder_pan_joint'] == pytest.approx(before, abs=0.02)


def test_what_is_in_its_way_stops_a_pushed_arm(world):
    """A person pushes the arm against a wall, but not through it."""
    wall = Body('wall', 'box', (0.04, 2.0, 2.0), (0.55, 0.0, 1.0))
    pushed = Disturbance('arm', 'torso', tuple(IN_VIEW.items()))
    world.reset(scene(wall, disturbances=(pushed,)))
    world.happened('torso')
    DirectRobot(world).torso(0.2)
    assert 'wall' in {contact.other for contact in world.contacts('robot')}
    assert world.tool_pose('left')[0, 3] < 0.56


def test_a_nudged_body_slides_and_stays_upright(world):
    nudge = Disturbance('nudge:can', 'see:2', (('dx', 0.05), ('dy', -0.04)))
    world.reset(scene(disturbances=(nudge,)))
    robot, before = DirectRobot(world), world.body_pose('can')
    robot.see()
    world.step(60)
    assert np.abs(world.body_pose('can') - before).max() < 1e-3
    robot.see()
    robot.gripper('left', 0.05)
    moved = world.body_pose('can')
    assert moved[:2, 3] - before[:2, 3] == pytest.approx([0.05, -0.04], abs=0.01)
    assert moved[2, 2] > 0.99 and max(world.body_speed('can')) < 0.05


def test_an_event_counts_from_the_reset(world):
    nudge = Disturbance('nudge:can', 'torso:2', (('dx', 0.05),))
    for _ in range(2):
        world.reset(scene(disturbances=(nudge,)))
        robot, before = DirectRobot(world), world.body_pose('can')[0, 3]
        robot.torso(0.201)
        assert world.body_pose('can')[0, 3] == pytest.approx(before, abs=1e-3)
        robot.torso(0.2)
        assert world.body_pose('can')[0, 3] > before + 0.03


def test_a_motion_against_a_push_fails_and_says_so(world):
    """Somebody takes the arm while it is being moved."""
    pushed = Disturbance('arm', 'torso', tuple(IN_VIEW.items()) + (('duration', 3.0),))
    world.reset(scene(disturbances=(pushed,)))
    world.happened('torso')
    with pytest.raises(RobotError, match='l_shoulder_pan_joint is .* off its path'):
        DirectRobot(world).follow(['l_shoulder_pan_joint'], np.array([[1.2]]), np.array([3.0]))


def test_a_door_swings_to_its_angle_and_is_then_left_to_itself(world):
    kitchen = draw_kitchen(3, benign=True)
    fridge = next(body for body in kitchen.bodies if body.name == 'fridge')
    ajar = fridge._replace(joints=((DOOR_JOINT, 1.8),))
    swing = Disturbance('swing:fridge', 'torso', (('angle', 0.7), ('duration', 1.0)))
    world.reset(
        kitchen._replace(
            bodies=tuple(ajar if body is fridge else body for body in kitchen.bodies),
            disturbances=(swing,),
        )
    )
    assert world.body_joint('fridge', DOOR_JOINT) == pytest.approx(1.8, abs=0.02)
    robot = DirectRobot(world)
    robot.torso(0.2)
    assert world.body_joint('fridge', DOOR_JOINT) == pytest.approx(0.7, abs=0.05)
    world.step(60)
    assert world.body_joint('fridge', DOOR_JOINT) == pytest.approx(0.7, abs=0.05)


def test_an_event_that_is_not_near_enough_is_not_counted(world):
    """The second image is the first one that the camera takes from there."""
    world.reset(scene())
    x, y, z = world.link_pose('wide_stereo_optical_frame')[:3, 3]
    away = Near((x + 0.5, y, z), 0.3)
    nudge = Disturbance('nudge:can', 'see', (('dx', 0.05),), near=away)
    world.reset(scene(disturbances=(nudge,)))
    robot, before = DirectRobot(world), world.body_pose('can')[0, 3]
    robot.see()
    world.step(60)
    assert world.body_pose('can')[0, 3] == pytest.approx(before, abs=1e-3)
    world.happened('see', place=np.array([x + 0.3, y, z]))
    world.step(60)
    assert world.body_pose('can')[0, 3] > before + 0.03


def test_a_drive_sets_off_when_what_its_beginning_has_set_off_is_over(world):
    nudge = Disturbance(
        'nudge:can', 'depart', (('dx', 0.05), ('duration', 1.0)), near=Near((-0.5, 0.0, 0.0), 0.1)
    )
    world.reset(scene(disturbances=(nudge,)))
    robot, before = DirectRobot(world), world.body_pose('can')[0, 3]
    robot.drive(from_rpy((-0.2, 0.0, 0.0)))
    assert world.body_pose('can')[0, 3] == pytest.approx(before, abs=1e-3)
    motion = BaseMotion(from_rpy((-0.5, 0.0, 0.0)))
    for _ in range(50):
        assert motion.tick(world) is None
        world.step()
    assert world.true_base()[0, 3] == pytest.approx(-0.2, abs=0.01), 'it waits'
    while motion.tick(world) is None:
        world.step()
    assert world.body_pose('can')[0, 3] > before + 0.03
    assert world.true_base()[0, 3] == pytest.approx(-0.5, abs=0.01)
