"""Damage in the real physics: what falls over, is dropped or pushed off is told, nothing else."""

import pybullet
import pytest
from worlds import CAN, CARTON, GOAL, TABLE, Hand, scene

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.simulation.physics.harm import (
    DROPPED,
    KNOCKED_OVER,
    PUSHED_OFF,
    Harm,
    harm_record,
)
from smach_oracle.simulation.physics.judge import judge
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot


@pytest.fixture(scope='module', name='world')
def make_world():
    one = World()
    yield one
    one.close()


def number_of(world, name):
    return next(index for index in range(20) if world.seen_as(index) == name)


def put(world, name, position, turn=(0.0, 0.0, 0.0)):
    pybullet.resetBasePositionAndOrientation(
        number_of(world, name),
        position,
        pybullet.getQuaternionFromEuler(turn),
        physicsClientId=world.client,
    )


def topple(world, name):
    put(world, name, world.body_pose(name)[:3, 3] + [0.0, 0.0, 0.01], (0.0, 1.0, 0.0))
    world.step(120)


def told(world):
    return tuple((each.kind, each.thing) for each in world.harm.found(world))


def slide(world, name, speed, periods):
    for _ in range(periods):
        world.slide_body(name, speed, 0.0)
        world.step()
    world.slide_body(name, 0.0, 0.0, let_go=True)


def test_what_stands_or_is_pushed_about_has_come_to_no_harm(world):
    world.reset(scene())
    slide(world, 'can', 0.2, 12)
    world.step(60)
    assert world.harm.found(world) == () and not world.harm.was_carried('can')


def test_what_falls_over_is_told_once(world):
    world.reset(scene())
    topple(world, 'carton')
    assert told(world) == ((KNOCKED_OVER, 'carton'),)
    seen_s = world.harm.found(world)[0].seen_s
    assert 0.0 < seen_s <= 2.0
    world.step(120)
    assert told(world) == ((KNOCKED_OVER, 'carton'),)
    assert world.harm.found(world)[0].seen_s == seen_s


def test_what_is_pushed_off_the_table_is_no_thing_that_was_dropped(world):
    world.reset(scene(TABLE, CAN._replace(position=(0.54, -0.2, 0.78)), CARTON))
    slide(world, 'can', -0.4, 30)
    world.step(10)
    assert told(world) == ((PUSHED_OFF, 'can'),), 'also while it falls'
    world.step(200)
    assert told(world) == ((PUSHED_OFF, 'can'),), 'and not knocked over besides'


def test_what_slips_out_of_the_hand_was_dropped(world):
    world.reset(scene())
    robot = DirectRobot(world)
    Hand(world, robot).take('can', lift=0.15)
    assert world.harm.was_carried('can') and not world.harm.found(world)
    robot.gripper('right', 0.085)
    world.step(120)
    assert (DROPPED, 'can') in told(world)
    assert all(each.thing == 'can' for each in world.harm.found(world))


def test_what_is_put_down_was_not_dropped(world):
    world.reset(scene())
    robot = DirectRobot(world)
    hand = Hand(world, robot)
    hand.take('can', lift=0.1)
    hand.go(from_rpy(world.tool_pose('right')[:3, 3] - [0.0, 0.0, 0.095], yaw=0.3), points=8)
    robot.gripper('right', 0.085)
    world.step(60)
    assert world.harm.was_carried('can') and world.harm.found(world) == ()


def test_a_new_trial_begins_without_harm(world):
    world.reset(scene())
    topple(world, 'carton')
    world.reset(scene())
    assert world.harm.found(world) == ()


def test_to_look_changes_nothing(world):
    def course(watched):
        world.reset(scene())
        if not watched:
            world.harm.tick = lambda _: None
        topple(world, 'carton')
        return world.body_pose('carton').tobytes()

    assert course(True) == course(False)


def test_another_thing_that_a_hand_brought_to_the_goal_is_a_false_success(world):
    goal = GOAL._replace(body='carton')
    world.reset(scene(goal=goal))
    Hand(world, DirectRobot(world)).take('can', lift=0.12)
    put(world, 'can', CAN.position)  # out of the hand
    world.step(60)
    found = judge(world, goal)
    assert not found.success and found.wrong_object == 'can'
    assert found.why.startswith('wrong object: can was brought, carton is')


def test_what_stood_at_the_goal_before_is_no_wrong_object(world):
    world.reset(scene(TABLE, CAN, CARTON, goal=GOAL._replace(body='carton')))
    found = judge(world, world.scene.goal)
    assert not found.success and found.wrong_object == ''


def test_a_truth_line_counts_and_names_what_came_to_harm():
    found = (Harm(KNOCKED_OVER, 'a', 1.5), Harm(DROPPED, 'b', 2.0), Harm(KNOCKED_OVER, 'c', 3.0))
    assert harm_record(found) == {
        'count': 3,
        'seen_s': [['knocked_over', 'a', 1.5], ['dropped', 'b', 2.0], ['knocked_over', 'c', 3.0]],
        'knocked_over': ['a', 'c'],
        'dropped': ['b'],
        'pushed_off': [],
    }
