"""The scenes of the first use case: they repeat, can be built, and fail for several reasons."""

import collections
import itertools

import numpy as np
import pybullet
import pytest
from drawn_scenes import drawn

from smach_oracle.simulation.physics.judge import judge
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.pick_and_place import rehearse
from smach_oracle.simulation.scenes.scene import Body, Goal, Scene
from smach_oracle.simulation.scenes.tabletop_causes import KINDS
from smach_oracle.simulation.scenes.tabletop_scene import GOAL, TASK, draw


def test_the_same_seed_gives_the_same_scene_and_another_another():
    assert draw(7) == draw(7)
    assert draw(7) != draw(8)


def test_a_benign_scene_has_no_cause_and_is_the_same_apart_from_that():
    for seed in range(25):
        scene = draw(seed, benign=True)
        assert not scene.causes and not scene.disturbances
        if not draw(seed).causes:
            assert draw(seed) == scene


def test_all_causes_come_up_and_their_share_is_as_it_should():
    counts: collections.Counter = collections.Counter()
    scenes = [drawn(TASK, seed) for seed in range(100, 700)]
    for scene in scenes:
        counts.update(cause.kind for cause in scene.causes)
        assert all(cause.text for cause in scene.causes)
    assert set(counts) == set(KINDS)
    assert 0.2 < np.mean([bool(scene.causes) for scene in scenes]) < 0.6


def test_nothing_stands_at_the_goal_and_the_things_stand_apart_and_at_rest():
    world = World()
    for seed in (1, 2, 3):
        scene = draw(seed, benign=True)
        world.reset(scene)
        assert not judge(world, scene.goal).success
        things = [body for body in scene.bodies if body.mass]
        assert len(things) >= 3
        for thing in things:
            there = world.body_pose(thing.name)
            assert np.linalg.norm(there[:3, 3] - thing.position) < 0.004 and there[2, 2] > 0.999
        nearest = min(things, key=lambda thing: np.hypot(*thing.position[:2]))
        assert nearest.name == 'object_0'
        assert np.hypot(nearest.position[0] - GOAL[0], nearest.position[1] - GOAL[1]) > 0.15
    world.close()


def test_other_things_have_many_shapes_and_colours_and_stand_clear_of_each_other():
    shapes: collections.Counter = collections.Counter()
    colours = set()
    for seed in range(60):
        target, *others = [body for body in draw(seed, benign=True).bodies if body.mass]
        assert target.shape in ('box', 'cylinder')
        shapes.update(body.shape for body in others)
        colours.update(body.colour for body in others)
        for one, other in itertools.combinations([target, *others], 2):
            away = np.hypot(*np.subtract(one.position, other.position)[:2])
            assert away > sum(map(reach, (one, other)))
    assert set(shapes) == {'box', 'cylinder', 'cup', 'bottle', 'round'}
    assert min(shapes.values()) > 10 and len(colours) > 50


def reach(body):
    """m from its middle, at most."""
    if body.shape == 'cylinder':
        return body.size[0]
    return (np.hypot(*body.size[:2]) if body.shape == 'box' else body.size[0]) / 2


def test_cups_and_bottles_stand_as_wide_and_high_as_they_should():
    table = Body('table', 'box', (0.7, 1.4, 0.04), (0.82, 0.0, 0.70))
    for shape in ('cup', 'bottle'):
        size = (0.08, 0.08, 0.20)
        world = World(
            Scene(
                'test',
                1,
                (table, Body('thing', shape, size, (0.7, 0.0, 0.821), mass=0.3)),
                Goal('stands_at', ''),
            )
        )
        world.step(60)
        number = next(k for k in range(4) if world.seen_as(k) == 'thing')
        low, high = pybullet.getAABB(number, physicsClientId=world.client)
        assert np.subtract(high, low) == pytest.approx(size, abs=0.006)
        assert world.body_pose('thing')[2, 2] > 0.9999
        assert world.body_pose('thing')[2, 3] == pytest.approx(0.82, abs=0.003)
        world.close()


@pytest.mark.parametrize('seed', range(1, 60))
def test_the_target_is_the_thing_that_stands_nearest(seed):
    scene = drawn(TASK, seed)
    things = {body.name: np.hypot(*body.position[:2]) for body in scene.bodies if body.mass > 0}
    assert scene.goal.body == min(things, key=things.get)


def test_a_rehearsal_in_a_world_of_its_own_leaves_none_behind():
    before = [number for number in range(50) if pybullet.isConnected(number)]
    scene = draw(3, benign=True)
    done = rehearse(scene._replace(bodies=(), goal=scene.goal._replace(body='')))
    assert done.failed == 'DETECT_TABLETOP' and not done.success
    assert [number for number in range(50) if pybullet.isConnected(number)] == before
