"""Things that are held for a while: a door by suction, fingers by a motor that is off, a can by a
dried drink. And a base that drives to one side.
"""

import numpy as np
import pybullet
import pytest
from worlds import scene

from smach_oracle.geometry.transforms import apply, from_rpy, yaw_of
from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.simulation.physics.bodies import SceneBuildError
from smach_oracle.simulation.physics.passing import pass_time
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT, fridge
from smach_oracle.simulation.scenes.scene import Disturbance, Goal, RobotStart, Scene, SceneCause

HANDLE = 0.5  # m from the hinge


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def caused(kind, after, *values):
    return Disturbance(kind, after, values, cause='held')


def told(world):
    (span,) = world.cause_spans()
    return span.began_s, span.ended_s


def kitchen(*values):
    return Scene(
        'test',
        1,
        (fridge(Kitchen()),),
        Goal('stands_at', ''),
        disturbances=(caused('suck:fridge', 'drive', *values),),
        causes=(SceneCause('held', ''),),
    )


def pulled(world, newtons, seconds):
    """Degrees of the door's hinge, pulled so long at its handle."""
    placed = world._placed['fridge']
    door = world.body_pose('fridge', 'door')
    point = apply(door, np.array([-0.05, -HANDLE, 1.0]))
    for _ in range(round(60 * seconds)):
        pybullet.applyExternalForce(
            placed.number,
            placed.links['door'],
            (door[:3, :3] @ [-newtons, 0.0, 0.0]).tolist(),
            point.tolist(),
            pybullet.WORLD_FRAME,
            physicsClientId=world.client,
        )
        world.step()
    return np.degrees(world.body_joint('fridge', DOOR_JOINT))


def test_suction_holds_a_door_less_and_less(world):
    world.reset(kitchen(('torque', 100.0), ('duration', 10.0)))
    assert told(world) == (None, None)
    world.happened('drive')
    assert pulled(world, 150.0, 1.0) < 0.6  # 75 N m in every other step of physics
    assert told(world) == (0.0, None)
    pass_time(world, 60 * 12)
    assert told(world) == (0.0, pytest.approx(10.0, abs=0.05))
    assert pulled(world, 150.0, 1.0) > 5.0


def test_air_comes_in_where_the_door_is_opened(world):
    world.reset(kitchen(('torque', 20.0), ('duration', 60.0)))
    world.happened('drive')
    assert pulled(world, 300.0, 0.5) > 1.0
    began, ended = told(world)
    assert began == 0.0 and 0.0 < ended < 0.5
    assert pulled(world, 40.0, 1.0) > 5.0  # it does not hold it any more


def test_fingers_stay_where_they_are_while_their_motor_is_off(world):
    halt = caused('halt:right', 'torso', ('duration', 3.0))
    world.reset(scene(disturbances=(halt,))._replace(causes=(SceneCause('held', ''),)))
    robot = DirectRobot(world)
    robot.gripper('right', 0.05)
    world.happened('torso')
    state = robot.gripper('right', 0.0)
    assert state.position == pytest.approx(0.05, abs=0.002) and state.stalled
    assert not robot.gripper('left', 0.02).stalled
    pass_time(world, 60 * 3)
    assert told(world)[1] - told(world)[0] == pytest.approx(3.0, abs=0.05)
    assert robot.gripper('right', 0.0).position < 0.01


def test_a_can_sticks_until_it_is_pulled_off(world):
    def sticking(force):
        stick = caused('stick:can', 'start', ('force', force))
        world.reset(scene(disturbances=(stick,))._replace(causes=(SceneCause('held', ''),)))
        return world._placed['can'].number

    def lifted(number, newtons):
        for _ in range(30):
            pybullet.applyExternalForce(
                number,
                -1,
                [0.0, 0.0, newtons],
                world.body_pose('can')[:3, 3].tolist(),
                pybullet.WORLD_FRAME,
                physicsClientId=world.client,
            )
            world.step()
        return float(world.body_pose('can')[2, 3])

    stands = lifted(sticking(40.0), 0.0)
    assert lifted(sticking(40.0), 50.0) == pytest.approx(stands, abs=0.004)
    assert told(world) == (0.0, None)
    assert lifted(sticking(10.0), 50.0) > stands + 0.02
    assert told(world)[1] is not None
    # it does not stick again
    assert 'can' not in world._sticking


def test_each_long_drive_ends_to_the_same_side_unknown_to_the_robot(world):
    bias = (0.0, 0.08, 0.04)
    world.reset(Scene('test', 1, (), Goal('stands_at', ''), RobotStart(drive_bias=bias)))
    robot = DirectRobot(world)
    for goal in ((1.0, 0.0, 0.0), (0.0, 0.5, 0.0)):
        robot.drive(from_rpy((goal[0], goal[1], 0.0)))
        off = world.true_base()
        assert off[:2, 3] - goal[:2] == pytest.approx((0.0, 0.08), abs=0.01)
        assert yaw_of(off) == pytest.approx(0.04, abs=0.01)
        assert world.odom_from_base()[:2, 3] == pytest.approx(goal[:2], abs=0.01)


@pytest.mark.parametrize(
    'kind, match',
    [('halt:tail', 'unknown arm'), ('stick:table', 'can be moved'), ('suck:can', 'with joints')],
)
def test_what_cannot_be_held_is_refused(world, kind, match):
    with pytest.raises(SceneBuildError, match=match):
        world.reset(scene(disturbances=(Disturbance(kind, 'start'),)))
