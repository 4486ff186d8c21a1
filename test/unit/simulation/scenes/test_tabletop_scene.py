"""The scenes of the first use case: they repeat, can be built, and fail for several reasons."""
import collections

import numpy as np
import pybullet
import pytest

from smach_oracle.simulation.physics.judge import judge
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.pick_and_place import rehearse
from smach_oracle.simulation.scenes.tabletop_causes import CHANCE
from smach_oracle.simulation.scenes.tabletop_scene import GOAL, draw


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
    scenes = [draw(seed) for seed in range(100, 700)]
    for scene in scenes:
        counts.update(cause.kind for cause in scene.causes)
        assert all(cause.text for cause in scene.causes)
    assert set(counts) == set(CHANCE)
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


@pytest.mark.parametrize('seed', range(1, 60))
def test_the_target_is_the_thing_that_stands_nearest(seed):
    scene = draw(seed)
    things = {body.name: np.hypot(*body.position[:2]) for body in scene.bodies if body.mass > 0}
    assert scene.goal.body == min(things, key=things.get)


def test_a_rehearsal_in_a_world_of_its_own_leaves_none_behind():
    before = [number for number in range(50) if pybullet.isConnected(number)]
    scene = draw(3, benign=True)
    done = rehearse(scene._replace(bodies=(), goal=scene.goal._replace(body='')))
    assert done.failed == 'DETECT_TABLETOP' and not done.success
    assert [number for number in range(50) if pybullet.isConnected(number)] == before
