"""Causes in the kitchen come at the moment of the script that they are about.

The script's states run in the world, with the code behind the real robot's actions. When a cause
came is read from the world's own log.
"""

import numpy as np
import pytest

from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.drink_retrieval import DrinkRetrievalRehearsal
from smach_oracle.simulation.rehearsal.pick_and_place import FAILURES
from smach_oracle.simulation.scenes import kitchen_causes, kitchen_scene
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT

LIGHTS = ('glare', 'reflex', 'dim_light', 'shadow')
FALLEN = 1.0  # rad. A door that swings back is open by less
SEEDS = (3, 11)


@pytest.fixture(scope='module')
def world():
    one = World(binning=2)
    yield one
    one.close()


def scene_with(monkeypatch, seed, *kinds):
    """The scene of a seed with these causes, and no other."""
    monkeypatch.setattr(
        kitchen_causes,
        'drawn_kinds',
        lambda *_: iter([(kind, np.random.default_rng([seed, *kind.encode()])) for kind in kinds]),
    )
    return kitchen_scene.draw(seed)


def tried(world, scene, last):
    """Run the script to a state, or until one fails.

    :returns: when each state began, s since the trial did, and all images so far by their time.
    """
    world.reset(scene)
    since, begins, images = world.time, {}, []
    trial = DrinkRetrievalRehearsal(world)
    see = trial.robot.see

    def told():
        image = see()
        images.append(image.stamp - since)
        return image

    trial.robot.see = told
    for name, work in trial.states:
        begins[name] = world.time - since
        try:
            work()
        except FAILURES:
            break
        if name == last:
            break
    return begins, images


def began(world, kind):
    """When a cause began, s since the trial did."""
    return next(span.began_s for span in world.cause_spans() if span.kind == kind)


@pytest.mark.parametrize('misplaced', [(), ('base_misplaced',)])
@pytest.mark.parametrize('seed', SEEDS)
def test_the_door_swings_back_when_the_robot_is_about_to_drive_in(
    monkeypatch, world, seed, misplaced
):
    scene = scene_with(monkeypatch, seed, 'door_swings_back', *misplaced)
    begins, _ = tried(world, scene, 'MOVE_IN')
    assert began(world, 'door_swings_back') == pytest.approx(begins['MOVE_IN'], abs=0.1)
    assert world.body_joint('fridge', DOOR_JOINT) < FALLEN


@pytest.mark.parametrize('misplaced', [(), ('base_misplaced',)])
@pytest.mark.parametrize('seed', SEEDS)
def test_light_changes_once_the_camera_has_turned_and_a_drink_moves_once_it_was_seen(
    monkeypatch, world, seed, misplaced
):
    scene = scene_with(monkeypatch, seed, 'drink_moved', *LIGHTS, *misplaced)
    begins, images = tried(world, scene, 'DETECT_DRINK')
    looked = min(moment for moment in images if moment > begins['DETECT_DRINK'])
    for kind in LIGHTS:
        assert begins['DETECT_DRINK'] < began(world, kind) < looked, kind
    assert began(world, 'drink_moved') == pytest.approx(looked, abs=0.1)
