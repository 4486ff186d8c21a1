"""Pictures for people: the robot hides nothing that they are about, and they change nothing."""

import math

import numpy as np
import pytest

from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.pictures.portrait import (
    AT_FRIDGE,
    AT_PERSON,
    portrait,
    rendered,
    usual_viewpoint,
)
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT
from smach_oracle.simulation.scenes.kitchen_scene import ORDERED, draw
from smach_oracle.tasks import drink_retrieval

SIZE = (240, 160)
HANDING_OVER, AT_SHELF = drink_retrieval.HOME, drink_retrieval.IN_THE_FRIDGE
ASIDE = (-1.5, 2.5, 0.0)  # where the robot hides nothing


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def kitchen(base):
    """An open refrigerator, and the robot where it stands."""
    scene = draw(1, benign=True)
    fridge = scene.bodies[0]._replace(joints=((DOOR_JOINT, math.radians(100)),))
    return scene._replace(
        bodies=(fridge,) + scene.bodies[1:], robot=scene.robot._replace(base=base)
    )


def pixels(world, base, viewpoint, name):
    """How many of them show a body."""
    world.reset(kitchen(base))
    bodies = rendered(world, SIZE, viewpoint).bodies
    return sum(
        int((bodies == index).sum())
        for index in np.unique(bodies[bodies >= 0])
        if world.seen_as(int(index)) == name
    )


@pytest.mark.parametrize(
    'base, viewpoint, names',
    [
        (HANDING_OVER, AT_PERSON, ['palm', 'person_head', 'person_chest']),
        (AT_SHELF, AT_FRIDGE, ['palm', 'person_head', 'person_chest', ORDERED]),
    ],
)
def test_the_robot_does_not_hide_the_person_nor_the_drink(world, base, viewpoint, names):
    for name in names:
        most = pixels(world, ASIDE, viewpoint, name)
        assert most > 20 and pixels(world, base, None, name) > 0.8 * most, name


def test_the_viewpoint_glides_along_with_the_robot(world):
    eyes = []
    for x in np.arange(-0.1, 1.1, 0.05):
        world.reset(kitchen((x, 0.0, 0.0)))
        eyes.append(usual_viewpoint(world).eye)
    assert (eyes[0], eyes[-1]) == (AT_PERSON.eye, AT_FRIDGE.eye)
    assert np.linalg.norm(np.diff(eyes, axis=0), axis=1).max() < 0.6


def test_pictures_change_nothing_in_a_trial(world):
    ends = []
    for filmed in (False, True):
        world.reset(kitchen(HANDING_OVER))
        robot = DirectRobot(world)
        for height in (0.16, 0.17, 0.18):
            if filmed:
                portrait(world, (48, 32))
            robot.torso(height)
        ends.append((world.periods, world.joints(), world.body_pose(ORDERED).tolist()))
    assert ends[0] == ends[1]
