"""How a trial leaves a lab: what stays, and what a person puts back or sets right."""

import numpy as np
import pybullet
import pytest

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.simulation.physics.leaving import left_by
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.tasks import TASKS, draw


@pytest.fixture
def world():
    made = World(draw(TASKS[0], 301, True), 2)
    yield made
    made.close()


def put(world, name, position, roll=0.0):
    """Put a body somewhere, and let it come to rest."""
    turn = pybullet.getQuaternionFromEuler([roll, 0.0, 0.0])
    pybullet.resetBasePositionAndOrientation(
        world._find(name).number, position, turn, physicsClientId=world.client
    )
    world.step(60)


def others(world):
    return [name for name in world.movable() if name != world.scene.goal.body]


def test_what_stands_stays_where_it_stands(world):
    name = others(world)[0]
    x, y, z = world.body_pose(name)[:3, 3]
    put(world, name, (x + 0.02, y - 0.15, z))
    state = left_by(world, True, 0.0, 0.1)
    found = {each.name: each for each in state.things}
    assert sorted(found) == sorted(others(world)), 'all but the thing of the task'
    assert found[name].position[:2] == pytest.approx((x + 0.02, y - 0.15), abs=0.005)
    assert found[name].colour == world.body(name).colour


@pytest.mark.parametrize('place', ['on the floor', 'lying'])
def test_what_fell_is_put_back_where_it_stood(world, place):
    name = others(world)[0]
    x, y, z = world.body_pose(name)[:3, 3]
    if place == 'lying':
        put(world, name, (x, y, z), roll=np.pi / 2)
    else:
        put(world, name, (-1.0, 1.0, 0.2))
    found = {each.name: each for each in left_by(world, True, 0.0, 0.1).things}
    assert found[name] == world.body(name)


def test_a_robot_that_did_its_task_is_left_as_it_stands():
    world = World(draw(TASKS[1], 301, True), 2)
    try:
        world.localise(from_rpy((0.3, 0.1, 0.0), yaw=0.2))
        state = left_by(world, True, 0.0, 0.1)
        joints = world.joints()
        assert {name: joints[name] for name, _ in state.joints} == dict(state.joints)
        assert state.base == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
        assert state.localisation == pytest.approx((0.3, 0.1, 0.2), abs=2e-3)
        assert left_by(world, False, 0.0, 0.1).joints == (), 'one that has failed is set right'
    finally:
        world.close()


def test_an_encoder_that_reads_beyond_a_limit_can_be_begun_from(world):
    limits = world.robot.limits
    for name, value in left_by(world, True, 0.0, 0.1).joints:
        assert limits[name][0] <= value <= limits[name][1]
        assert not world.robot.refusal(name, value)
