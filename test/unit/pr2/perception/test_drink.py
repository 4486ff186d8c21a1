"""Detection of a drink in a refrigerator: its door, its shelf, what stands there, and a map that is
not quite right.
"""
import numpy as np
import pytest
from ray_camera import camera_at, see

from smach_oracle.geometry.transforms import apply, from_rpy
from smach_oracle.pr2.kitchen import Kitchen, fridge_boxes, look_point
from smach_oracle.pr2.perception.clusters import NotSeen
from smach_oracle.pr2.perception.drink import find_drink
from smach_oracle.simulation.scenes.scene import Body

KITCHEN = Kitchen()
FRIDGE = from_rpy((0.72, 0.1, 0.0), yaw=0.02)  # in the frame of the base
FLOOR = Body('floor', 'box', (3.0, 4.0, 0.02), (2.0, 0.0, -0.01), colour=(0.6, 0.6, 0.6))


def fridge(door_degrees):
    return [
        Body('fridge', 'box', tuple(2 * box.half), tuple(box.centre), yaw=box.yaw,
             colour=(0.9, 0.9, 0.93))
        for box in fridge_boxes(KITCHEN, FRIDGE, np.radians(door_degrees))
    ]


def drink(x, y, radius=0.031, height=0.12, colour=(0.8, 0.2, 0.1)):
    """At a place of the shelf, in the fridge's frame."""
    shelf = KITCHEN.shelves[KITCHEN.drinks_shelf]
    place = apply(FRIDGE, np.array([x, y, shelf + height / 2]))
    return Body('drink', 'cylinder', (radius, radius, height), tuple(place), colour=colour)


def image_of(bodies, door=90.0, seed=0, noise=1.0, target=None):
    target = look_point(KITCHEN, FRIDGE) if target is None else target
    return see([FLOOR] + fridge(door) + list(bodies), camera_at((0.05, 0.03, 1.45), target),
               np.random.default_rng(seed), noise).image


def reason(image):
    with pytest.raises(NotSeen) as error:
        find_drink(image, KITCHEN, FRIDGE)
    return str(error.value)


@pytest.mark.parametrize('door', [65.0, 90.0])
@pytest.mark.parametrize('noise', [1.0, 4.0])
def test_the_foremost_drink_is_found_though_the_map_is_wrong_by_centimetres(door, noise):
    errors = []
    for seed in range(3):
        believed = FRIDGE @ from_rpy(np.r_[np.random.default_rng(seed).normal(0, 0.025, 2), 0.0],
                                     yaw=0.03)
        front, behind = drink(0.08, -0.1), drink(0.2, 0.05, colour=(0.1, 0.5, 0.8))
        found = find_drink(image_of([behind, front], door, seed, noise), KITCHEN, believed)
        errors.append(np.linalg.norm(found.centre - front.position))
        assert np.allclose(found.size, [0.062, 0.062, 0.12], atol=0.006 + 0.006 * noise)
    assert np.median(errors) < 0.01
    assert max(errors) < 0.015


@pytest.mark.parametrize('door', [0.0, 30.0, 40.0])
def test_a_door_in_the_way_is_the_reason(door):
    assert 'the door hides' in reason(image_of([drink(0.08, 0.0)], door))


def test_an_empty_shelf_is_said_to_be_empty():
    assert reason(image_of([])) == 'no drink: there is nothing on the shelf'


def test_a_camera_that_looks_elsewhere_is_the_reason():
    assert 'the camera does not look into' in reason(
        image_of([drink(0.08, 0.0)], target=(0.5, 1.5, 0.8)))


def test_what_has_not_the_size_of_a_drink_is_none():
    assert 'has not the size of a drink' in reason(image_of([drink(0.08, 0.0, radius=0.012)]))
    assert 'too large' in reason(image_of([drink(0.12, 0.0, radius=0.06)]))


def test_drinks_that_touch_are_not_taken_for_one():
    text = reason(image_of([drink(0.1, -0.031), drink(0.1, 0.031)]))
    assert 'touch' in text
    third = drink(0.12, 0.17)
    found = find_drink(image_of([drink(0.1, -0.031), drink(0.1, 0.031), third]), KITCHEN, FRIDGE)
    assert np.linalg.norm(found.centre -
                          third.position) < 0.01, 'another that stands free is as good'


def test_missing_depth_is_the_reason():
    image = image_of([drink(0.08, 0.0)])
    assert 'depth is missing for 100%' in reason(
        image._replace(depth=np.full_like(image.depth, np.nan)))
