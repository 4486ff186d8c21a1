"""The world: it repeats to the bit, stands still, holds what is held, and refuses nonsense by
name.
"""

import math

import numpy as np
import pytest
from worlds import CAN, CARTON, TABLE, Hand, empty, scene

from smach_oracle.geometry.transforms import from_rpy, inverse, yaw_of
from smach_oracle.pr2.robot import ARM_JOINTS
from smach_oracle.simulation.physics.bodies import SceneBuildError
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import CameraQuality, Disturbance, Near, RobotStart


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def state(world):
    """All that can differ."""
    bodies = b''.join(world.body_pose(name).tobytes() for name in world.body_names)
    return bodies + repr(sorted(world.joints().items())).encode() + world.odom_from_base().tobytes()


def eventful(world):
    """A bit of everything; the states on the way."""
    world.reset(
        scene(
            robot=RobotStart(drive_error=(0.02, 0.02, 0.01)),
            disturbances=(Disturbance('nudge:carton', 'look_at', (('dx', 0.03),)),),
        )
    )
    robot = DirectRobot(world)
    robot.look_at((0.7, 0.0, 0.75))
    states = [state(world)]
    Hand(world, robot).take('can')
    states.append(state(world))
    robot.drive(from_rpy((-0.1, 0.0, 0.0), yaw=0.1))
    image = robot.see()
    return states + [state(world), image.colour.tobytes(), image.depth.tobytes()]


def test_the_same_scene_and_calls_give_the_same_states_to_the_last_bit(world):
    first = eventful(world)
    world.reset(scene(TABLE, CARTON))
    world.step(7)
    assert eventful(world) == first


def test_time_goes_on_over_resets(world):
    world.reset(scene())
    before = world.time
    world.step(60)
    assert world.time == pytest.approx(before + 1.0)
    world.reset(scene())
    assert world.time > before + 1.0


def test_things_stand_still_from_the_start(world):
    world.reset(scene())
    before = {name: world.body_pose(name) for name in world.body_names}
    assert all(max(world.body_speed(name)) < 1e-3 for name in ('can', 'carton'))
    world.step(120)
    for name, pose in before.items():
        assert np.abs(world.body_pose(name) - pose).max() < 1e-3, name
    assert {contact.other for contact in world.contacts('can')} == {'table'}


def test_the_robot_stands_as_the_scene_says_and_holds_itself(world):
    world.reset(
        empty(
            robot=RobotStart(
                (('torso_lift_joint', 0.1), ('r_elbow_flex_joint', -1.0)), (1.0, -0.5, 0.3)
            )
        )
    )
    world.step(60)
    assert world.joints()['torso_lift_joint'] == pytest.approx(0.1, abs=1e-3)
    assert world.joints()['r_elbow_flex_joint'] == pytest.approx(-1.0, abs=2e-3)
    assert world.true_base()[:2, 3] == pytest.approx([1.0, -0.5], abs=1e-3)
    assert yaw_of(world.odom_from_base()) == pytest.approx(0.3, abs=1e-3)
    assert world.link_pose('base_link')[2, 3] == pytest.approx(0.051, abs=1e-4)


def test_a_grasped_can_survives_a_lift_and_a_shake(world):
    world.reset(scene())
    hand = Hand(world, DirectRobot(world))
    grasp = hand.take('can')
    assert grasp.stalled and not grasp.reached and grasp.position == pytest.approx(0.062, abs=2e-3)
    assert world.holding('can') == 'right' and world.body_pose('can')[2, 3] > 0.86
    before = inverse(world.tool_pose('right')) @ world.body_pose('can')
    hand.shake()
    after = inverse(world.tool_pose('right')) @ world.body_pose('can')
    assert world.holding('can') == 'right' and world.gap('right') > 0.05
    assert np.linalg.norm(after[:3, 3] - before[:3, 3]) < 0.02


def test_a_slippery_can_stays_behind(world):
    world.reset(scene(TABLE, CAN._replace(friction=0.04)))
    Hand(world, DirectRobot(world)).take('can')
    assert world.holding('can') == '' and world.body_pose('can')[2, 3] < 0.80


def test_each_drive_errs_anew_and_the_same_way_for_the_same_trial(world):
    misses = []
    for _ in range(2):
        world.reset(empty(robot=RobotStart(drive_error=(0.05, 0.05, 0.02))))
        robot = DirectRobot(world)
        for goal in (from_rpy((0.2, 0, 0)), from_rpy((0.2, 0.1, 0), yaw=0.2)):
            robot.drive(goal)
            assert np.abs(world.odom_from_base() - goal).max() < 5e-3  # it believes to be there
            misses.append(world.true_base()[:2, 3] - goal[:2, 3])
    assert np.array_equal(misses[:2], misses[2:])
    assert (
        0.005 < np.linalg.norm(misses[0]) < 0.25 and np.linalg.norm(misses[1] - misses[0]) > 0.005
    )


def test_a_short_drive_keeps_most_of_the_error_that_there_was(world):
    world.reset(empty(robot=RobotStart(drive_error=(0.05, 0.05, 0.02))))
    robot = DirectRobot(world)
    robot.drive(from_rpy((1.0, 0, 0)))
    before = world.belief_error.copy()
    robot.drive(from_rpy((0.98, 0, 0)))
    after = world.belief_error
    assert (
        0.0
        < np.linalg.norm(after[:2, 3] - before[:2, 3])
        < 0.04 * 3 * 0.05 + 0.04 * np.linalg.norm(before[:2, 3])
    )
    assert np.linalg.norm(before[:2, 3]) > 0.01


def test_clients_are_given_back(world):
    numbers = set()
    for _ in range(8):
        world.reset(empty())
        numbers.add(world.client)
    assert len(numbers) <= 2


@pytest.mark.parametrize(
    'wrong, text',
    [
        (scene(TABLE, TABLE), "'table'.*taken"),
        (scene(TABLE._replace(name='robot')), "'robot'"),
        (
            scene(CAN._replace(shape='sphere')),
            "'can': shape is 'sphere'; allowed: bottle, box, cup, cylinder, round, urdf",
        ),
        (scene(CAN._replace(size=(0.03, 0.03, 0.0))), "'can': size"),
        (scene(CAN._replace(mass=math.nan)), "'can': mass nan"),
        (scene(CAN._replace(position=(0.0, math.inf, 0.0))), "'can': position"),
        (scene(CAN._replace(shape='urdf', urdf='<robot')), "'can': its urdf cannot be read"),
        (
            scene(
                CAN._replace(
                    shape='urdf',
                    urdf='<robot name="a"><link name="b"/></robot>',
                    joints=(('hinge', 0.0),),
                )
            ),
            "'can': no joint 'hinge'",
        ),
        (
            scene(CAN._replace(shape='urdf', joints=(('hinge', math.nan),))),
            "'can': joint 'hinge' is given nan",
        ),
        (scene()._replace(goal=scene().goal._replace(body='cup')), "'cup'.*can, carton"),
        (scene(camera=CameraQuality(dropout=1.5)), 'dropout'),
        (scene(robot=RobotStart((('r_elbow_joint', 0.0),))), "no joint 'r_elbow_joint'"),
        (
            scene(robot=RobotStart((('r_elbow_flex_joint', 1.0),))),
            'r_elbow_flex_joint .* at 1; allowed: -2.321 to 0',
        ),
        (
            scene(disturbances=(Disturbance('earthquake', 'see'),)),
            "'earthquake': unknown kind; allowed: arm, dim",
        ),
        (
            scene(disturbances=(Disturbance('dim', 'lunch'),)),
            "'dim': unknown event 'lunch'; allowed: start, follow",
        ),
        (scene(disturbances=(Disturbance('dim', 'see:²'),)), "'dim': unknown event 'see:²'"),
        (
            scene(disturbances=(Disturbance('dim', 'see', near=Near((0.0, 0.0, math.inf), 1.0)),)),
            'near is .*allowed: a place of finite m',
        ),
        (
            scene(disturbances=(Disturbance('dim', 'see', near=Near((0.0, 0.0, 0.0), 0.0)),)),
            'within more than 0 m',
        ),
        (scene(disturbances=(Disturbance('nudge:cup', 'see'),)), "no body 'cup'"),
        (
            scene(disturbances=(Disturbance('arm', 'see', (('l_elbow_joint', 0.0),)),)),
            "no joint 'l_elbow_joint'",
        ),
        (
            scene(disturbances=(Disturbance('arm', 'see', (('torso_lift_joint', 0.1),)),)),
            'joints of arms .*allowed: those of one',
        ),
        (scene(disturbances=(Disturbance('glare', 'see', (('radius', -1.0),)),)), 'radius is -1'),
    ],
)
def test_a_scene_that_cannot_be_is_refused_by_name_and_the_world_stays(world, wrong, text):
    world.reset(scene())
    with pytest.raises(SceneBuildError, match=text):
        world.reset(wrong)
    world.step()
    assert world.body_names == ['table', 'can', 'carton']


def test_unknown_names_and_values_are_refused_with_those_that_are_allowed(world):
    world.reset(scene())
    for call, text in (
        (lambda: world.body_pose('cup'), "no body 'cup'.*can"),
        (lambda: world.body_joint('can', 'lid'), "no joint 'lid' in 'can'"),
        (lambda: world.body_pose('can', 'lid'), "no link 'lid' in 'can'"),
        (lambda: world.link_pose('nose'), "no link 'nose'.*base_link"),
        (lambda: world.gap('middle'), "'middle'; allowed: left, right"),
        (lambda: world.set_target('nose', 0.0), "no joint 'nose'"),
        (lambda: world.set_target('r_elbow_flex_joint', math.nan), 'cannot be at nan'),
        (lambda: world.set_target('r_elbow_flex_joint', -1.0, math.inf), 'velocity is inf'),
        (lambda: world.set_gripper('left', math.nan, 5.0), 'gap nan'),
        (lambda: world.set_gripper('left', 0.0, -5.0), '-5.0 N'),
    ):
        with pytest.raises(ValueError, match=text):
            call()


def test_a_joint_goes_where_it_is_sent(world):
    world.reset(empty())
    name = ARM_JOINTS['left'][3]
    for k in range(60):
        world.set_target(name, -1.5 + 0.01 * (k + 1), 0.6)
        world.step()
    assert world.joints()[name] == pytest.approx(-0.9, abs=2e-3)
    assert world.joint_velocities()[name] == pytest.approx(0.6, abs=0.05)
    world.step()
    assert abs(world.joint_velocities()[name]) < 0.05 and len(world.joint_efforts()) == 22
