"""Causes in the kitchen come at the moment of the script that they are about.

The script's states run in the world, with the code behind the real robot's actions. When a cause
came is read from the world's own log.
"""

from typing import Dict, List, NamedTuple

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


@pytest.fixture(name='world', scope='module')
def _world():
    one = World(binning=2)
    yield one
    one.close()


def scene_with(seed, *kinds):
    """The scene of a seed with these causes, and no other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            kitchen_causes,
            'drawn_kinds',
            lambda *_: iter(
                [(kind, np.random.default_rng([seed, *kind.encode()])) for kind in kinds]
            ),
        )
        return kitchen_scene.draw(seed)


class _Course(NamedTuple):
    """What a trial has shown."""

    begins: Dict[str, float]  # when each state began, s since the trial did
    images: List[float]  # when each was taken
    causes: Dict[str, float]  # when each began
    door: float  # rad that it stood open when the robot had driven in


@pytest.fixture(
    name='course',
    scope='module',
    params=[(seed, more) for seed in SEEDS for more in ((), ('base_misplaced',))],
)
def _course(request, world):
    """The script, run until the drink is looked for or a state fails, with all causes."""
    seed, more = request.param
    scene = scene_with(seed, 'door_swings_back', 'drink_moved', *LIGHTS, *more)
    world.reset(scene)
    since, begins, images, door = world.time, {}, [], None
    trial = DrinkRetrievalRehearsal(world)
    see = trial.robot.see

    def told():
        image = see()
        images.append(image.stamp - since)
        return image

    trial.robot.see = told
    for name, work in trial.states[:5]:
        begins[name] = world.time - since
        try:
            work()
        except FAILURES:
            break
        finally:
            if name == 'MOVE_IN':
                door = world.body_joint('fridge', DOOR_JOINT)
    causes = {span.kind: span.began_s for span in world.cause_spans()}
    return _Course(begins, images, causes, door)


def test_the_door_swings_back_when_the_robot_is_about_to_drive_in(course):
    began = course.causes['door_swings_back']
    assert began == pytest.approx(course.begins['MOVE_IN'], abs=0.1)
    assert course.door < FALLEN


def test_light_changes_once_the_camera_has_turned_and_a_drink_moves_once_it_was_seen(course):
    begun = course.begins['DETECT_DRINK']
    looked = min(moment for moment in course.images if moment > begun)
    for kind in LIGHTS:
        assert begun < course.causes[kind] < looked, kind
    assert course.causes['drink_moved'] == pytest.approx(looked, abs=0.1)
