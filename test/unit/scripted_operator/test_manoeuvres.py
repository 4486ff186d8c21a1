"""The scripted operator's hand in the world, without ROS: it takes things, puts them down, and
knows when it failed.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from direct_hand import DirectHand, DirectWatcher

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.scripted_operator.hand_driver import HandDriver, StuckError
from smach_oracle.scripted_operator.manoeuvres import (
    Attempt,
    ManoeuvreError,
    _check_stands,
    grasps,
    pick,
    put_down,
)
from smach_oracle.scripted_operator.seen_scene import SeenScene, SeenThing
from smach_oracle.simulation.physics.judge import judge
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.tabletop_scene import GOAL, TABLE_TOP, draw


@pytest.fixture(scope='module', name='world')
def make_world():
    world = World(binning=2)
    yield world
    world.close()


def attempt(world, number=0, sigma=0.004):
    generator = np.random.default_rng(number)
    return Attempt(
        HandDriver(DirectHand(world, 'right')),
        DirectWatcher(world),
        number,
        lambda: generator.normal(0.0, sigma, 3),
    )


def about(world, name='object_0'):
    """Where a thing stands, by about as much as a person remembers it."""
    return world.body_pose(name)[:3, 3] + [0.04, -0.05, 0.03]


@pytest.mark.parametrize('seed', (2, 5))
def test_a_thing_is_taken_and_put_down_where_it_shall_stand(world, seed):
    world.reset(draw(seed, benign=True))
    at = attempt(world)
    pick(at, SeenScene.wanted, about(world))
    assert world.holding('object_0') == 'right'
    lifted = world.body_pose('object_0')[2, 3] - world.body('object_0').size[2] / 2
    assert lifted > TABLE_TOP + 0.08
    place = np.array([GOAL[0], GOAL[1], TABLE_TOP + 0.08])
    put_down(at, place, at.watcher.look_at(place).surface_at(place))
    verdict = judge(world, world.scene.goal)
    assert verdict.success, verdict.why
    assert world.harm.found(world) == (), 'nothing fell over'


def test_a_hand_that_misses_says_so_and_comes_away_open(world):
    world.reset(draw(2, benign=True))
    at = attempt(world)._replace(slip=lambda: np.array([0.0, 0.0, 0.12]))
    with pytest.raises(ManoeuvreError, match='closed on nothing'):
        pick(at, SeenScene.wanted, about(world))
    assert world.gap('right') > 0.07 and world.holding('object_0') == ''


def test_nothing_to_take_and_nothing_to_put_down(world):
    world.reset(draw(2, benign=True))
    with pytest.raises(ManoeuvreError, match='nothing to take'):
        pick(attempt(world), lambda scene: None, about(world))
    with pytest.raises(ManoeuvreError, match='holds nothing'):
        put_down(attempt(world), np.array([0.6, -0.35, 0.8]), None)


def test_a_place_beyond_reach_is_told_with_what_stopped_the_hand(world):
    world.reset(draw(2, benign=True))
    with pytest.raises(StuckError, match='the hand stays .* cm'):
        HandDriver(DirectHand(world, 'right')).go(from_rpy((1.8, 0.0, 1.0)))


def test_grasps_avoid_what_stands_beside_and_before():
    can = UprightBox(np.array([0.6, -0.1, 0.78]), np.array([0.06, 0.06, 0.12]), 0.0)
    alone = grasps(can, [], 'right')[0]
    before = UprightBox(
        alone[:3, 3] - 0.09 * alone[:3, 0] * [1, 1, 0], np.array([0.06, 0.06, 0.12]), 0.0
    )
    past = grasps(can, [before], 'right')[0]
    assert (
        abs(np.arctan2(*past[1::-1, 0]) - np.arctan2(*alone[1::-1, 0])) > 0.2
        or past[2, 0] < alone[2, 0] - 0.2
    )
    wide = can._replace(size=np.array([0.2, 0.2, 0.12]))
    assert grasps(wide, [], 'right') == []


@pytest.mark.parametrize(
    'tall, beside, says',
    [(0.12, 0.0, ''), (0.06, 0.0, 'lies at its place'), (0.12, 0.08, '8 cm beside')],
)
def test_what_was_put_down_is_looked_at(tall, beside, says):
    place = np.array([0.6, -0.3, 0.78])
    box = UprightBox(place + [beside, 0.0, 0.0], np.array([0.06, 0.06, tall]), 0.0)
    seen = SeenScene([SeenThing('can', True, True, (0, 0, 1, 1), np.ones((1, 1), bool), box)], None)
    watcher = SimpleNamespace(look_at=lambda point: seen, tall=lambda name: 0.12)
    looked = Attempt(None, watcher, 0, lambda: np.zeros(3))
    if not says:
        _check_stands(looked, 'can', place)
        return
    with pytest.raises(ManoeuvreError, match=says):
        _check_stands(looked, 'can', place)
