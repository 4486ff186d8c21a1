"""The judge: he knows success from what only looks like it."""

import re

import pybullet
import pytest
from worlds import CAN, GOAL, TABLE, Hand, scene

from smach_oracle.simulation.physics.judge import judge
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import Body, Goal

PALM = Body('palm', 'box', (0.2, 0.2, 0.03), (0.7, -0.2, 0.705), colour=(0.8, 0.6, 0.5))
IN_HAND = Goal('in_hand', '', (0.7, -0.2, 0.72), 0.08)


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def verdict(world, *bodies, goal=GOAL):
    world.reset(scene(*bodies, goal=goal))
    return judge(world, goal)


def test_what_stands_at_its_goal_is_a_success(world):
    found = verdict(world)
    assert found.success and found.why.startswith('can stands at its goal')


@pytest.mark.parametrize(
    'can, why',
    [
        (CAN._replace(position=(0.80, -0.20, 0.78)), '10.0 cm from the goal'),
        (CAN._replace(position=(0.70, -0.20, 0.755), roll=1.5708), 'does not stand upright'),
        (CAN._replace(position=(0.70, -0.20, 2.3)), 'is not at rest.*too high.*stands on nothing'),
        (CAN._replace(position=(0.70, -1.20, 0.06)), '72 cm too low'),
    ],
)
def test_what_is_no_success_has_its_reason(world, can, why):
    found = verdict(world, TABLE, can)
    assert not found.success
    assert re.search(why, found.why), found.why


def test_any_body_that_was_carried_will_do_where_the_goal_names_none(world):
    goal = GOAL._replace(body='')
    elsewhere = CAN._replace(position=(CAN.position[0], CAN.position[1] + 0.12, CAN.position[2]))
    world.reset(scene(TABLE, elsewhere, goal=goal))
    assert not judge(world, goal).success
    number = next(index for index in range(20) if world.seen_as(index) == 'can')
    pybullet.resetBasePositionAndOrientation(
        number, CAN.position, (0.0, 0.0, 0.0, 1.0), physicsClientId=world.client
    )
    world.step(60)
    assert judge(world, goal).success
    assert not verdict(world, TABLE, goal=goal).success


def test_what_was_pushed_to_the_goal_was_not_brought_there(world):
    found = verdict(world, goal=GOAL._replace(body='', position=CAN.position))
    assert not found.success and 'never carried' in found.why


def test_what_the_robot_still_holds_is_no_success(world):
    world.reset(scene())
    Hand(world, DirectRobot(world)).take('can', lift=0.0)
    found = judge(world, GOAL)
    assert not found.success and 'touched by the robot' in found.why


def test_a_drink_must_lie_in_the_palm(world):
    assert verdict(world, PALM, CAN, goal=IN_HAND).success
    beside = CAN._replace(position=(0.70, -0.20, 0.78), name='drink')
    found = verdict(world, TABLE, beside, goal=IN_HAND)
    assert not found.success and 'does not lie in the palm' in found.why


def test_judging_changes_nothing_and_an_unknown_goal_is_refused(world):
    world.reset(scene())
    before = world.time, world.body_pose('can').tobytes()
    judge(world, GOAL)
    assert (world.time, world.body_pose('can').tobytes()) == before
    with pytest.raises(ValueError, match="'hovers'; allowed: 'stands_at', 'in_hand'"):
        judge(world, GOAL._replace(kind='hovers'))
