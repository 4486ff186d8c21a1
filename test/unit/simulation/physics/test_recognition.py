"""What a person recognises in an image: what is visible there, by outlines that err, no more."""

import numpy as np
import pytest
from worlds import CAN, CARTON, TABLE, scene

from smach_oracle.simulation.physics.camera import see
from smach_oracle.simulation.physics.recognition import (
    chance_of,
    drawn,
    legible,
    recognised,
    view_of,
)
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.scene import Body, CameraQuality, RobotStart

BOWED = RobotStart((('head_tilt_joint', 0.75),))
WALL = Body('wall', 'box', (0.02, 0.5, 0.5), (0.52, -0.23, 0.97), colour=(0.4, 0.4, 0.4))


@pytest.fixture(scope='module', name='world')
def make_world():
    one = World()
    yield one
    one.close()


def seen(world, *bodies, names=('can', 'carton'), **more):
    world.reset(scene(*bodies, robot=BOWED, **more))
    view = view_of(world, see(world).colour)
    return view, recognised(view, names)


def test_outlines_are_about_the_pixels_that_show_a_thing_and_never_just_these(world):
    view, found = seen(world)
    assert sorted(found) == ['can', 'carton']
    for name, outline in found.items():
        number = next(number for number, each in view.names.items() if each == name)
        shown = view.labels == number
        both, either = (outline & shown).sum(), (outline | shown).sum()
        assert 0.75 < both / either < 1.0


def test_only_what_is_looked_for_is_told(world):
    view, found = seen(world, names=('carton', 'floor', 'cup'))
    assert sorted(found) == ['carton']
    assert 'table' in recognised(view, ['table'])


def test_what_is_hidden_is_not_recognised_and_of_what_is_half_hidden_the_rest(world):
    _, hidden = seen(world, TABLE, CAN, CARTON, WALL)
    assert sorted(hidden) == ['carton']
    _, free = seen(world)
    _, half = seen(world, TABLE, CAN, CARTON, WALL._replace(position=(0.52, -0.38, 0.97)))
    assert 0.1 < half['can'].sum() / free['can'].sum() < 0.9


@pytest.mark.parametrize('brightness, there', [(1.0, True), (0.15, True), (0.01, False)])
def test_in_the_dark_nobody_recognises_anything(world, brightness, there):
    _, found = seen(world, camera=CameraQuality(brightness=brightness))
    assert ('can' in found) == there


def test_nobody_sees_into_a_glare():
    colour = np.full((60, 80, 3), 120, np.uint8)
    colour[:, 40:] = 255
    told = legible(colour)
    assert told[:, :36].all() and not told[:, 44:].any()


def test_the_same_image_is_outlined_the_same_and_another_one_otherwise(world):
    _, one = seen(world)
    _, other = seen(world)
    assert (one['can'] == other['can']).all()
    world.step(2)
    later = recognised(view_of(world, see(world).colour), ['can'])
    assert (later['can'] != one['can']).any()


def test_an_outline_errs_by_a_few_pixels():
    shown = np.zeros((480, 640), bool)
    shown[200:300, 300:360] = True
    errors = [
        (drawn(shown, np.random.default_rng(seed)) ^ shown).sum() / 320 for seed in range(10)
    ]  # by the length of the edge
    assert 0.7 < np.mean(errors) < 4.0, 'pixels'


def test_chance_repeats_with_the_trial_and_is_not_its_seed():
    assert chance_of(7) == chance_of(7) != chance_of(8)
    assert chance_of(7) != 7
