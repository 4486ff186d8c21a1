"""Detection of a drink in a refrigerator: its door, its shelf, what stands there, and a map that is
not quite right.
"""

import numpy as np
import pytest
from ray_camera import camera_at, see

from smach_oracle.geometry.depth import pixels_of
from smach_oracle.geometry.transforms import apply, from_rpy
from smach_oracle.pr2.kitchen import Kitchen, fridge_boxes, look_point
from smach_oracle.pr2.perception.clusters import NotSeen
from smach_oracle.pr2.perception.colours import name_of
from smach_oracle.pr2.perception.drink import find_drink
from smach_oracle.simulation.scenes.scene import Body

KITCHEN = Kitchen()
FRIDGE = from_rpy((0.72, 0.1, 0.0), yaw=0.02)  # in the frame of the base
FLOOR = Body('floor', 'box', (3.0, 4.0, 0.02), (2.0, 0.0, -0.01), colour=(0.6, 0.6, 0.6))


def fridge(door_degrees):
    return [
        Body(
            'fridge',
            'box',
            tuple(2 * box.half),
            tuple(box.centre),
            yaw=box.yaw,
            colour=(0.9, 0.9, 0.93),
        )
        for box in fridge_boxes(KITCHEN, FRIDGE, np.radians(door_degrees))
    ]


def drink(x, y, radius=0.031, height=0.12, colour=(0.8, 0.2, 0.1)):
    """At a place of the shelf, in the fridge's frame."""
    shelf = KITCHEN.shelves[KITCHEN.drinks_shelf]
    place = apply(FRIDGE, np.array([x, y, shelf + height / 2]))
    return Body('drink', 'cylinder', (radius, radius, height), tuple(place), colour=colour)


def image_of(bodies, door=90.0, seed=0, noise=1.0, target=None):
    target = look_point(KITCHEN, FRIDGE) if target is None else target
    return see(
        [FLOOR] + fridge(door) + list(bodies),
        camera_at((0.05, 0.03, 1.45), target),
        np.random.default_rng(seed),
        noise,
    ).image


def reason(image):
    with pytest.raises(NotSeen) as error:
        find_drink(image, KITCHEN, FRIDGE)
    return str(error.value)


@pytest.mark.parametrize('door', [65.0, 90.0])
@pytest.mark.parametrize('noise', [1.0, 4.0])
def test_the_foremost_drink_is_found_though_the_map_is_wrong_by_centimetres(door, noise):
    errors = []
    for seed in range(3):
        believed = FRIDGE @ from_rpy(
            np.r_[np.random.default_rng(seed).normal(0, 0.025, 2), 0.0], yaw=0.03
        )
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
        image_of([drink(0.08, 0.0)], target=(0.5, 1.5, 0.8))
    )


def test_what_has_not_the_size_of_a_drink_is_none():
    assert 'has not the size of a drink' in reason(image_of([drink(0.08, 0.0, radius=0.012)]))
    assert 'too large' in reason(image_of([drink(0.12, 0.0, radius=0.06)]))


def test_drinks_that_touch_are_not_taken_for_one():
    text = reason(image_of([drink(0.1, -0.031), drink(0.1, 0.031)]))
    assert 'touch' in text
    third = drink(0.12, 0.17)
    found = find_drink(image_of([drink(0.1, -0.031), drink(0.1, 0.031), third]), KITCHEN, FRIDGE)
    assert np.linalg.norm(found.centre - third.position) < 0.01, (
        'another that stands free is as good'
    )


def test_missing_depth_is_the_reason():
    image = image_of([drink(0.08, 0.0)])
    assert 'depth is missing for 100%' in reason(
        image._replace(depth=np.full_like(image.depth, np.nan))
    )


def test_the_drink_of_the_colour_is_found_and_no_other():
    red, green = drink(0.08, -0.1), drink(0.18, 0.05, colour=(0.12, 0.45, 0.2))
    image = image_of([red, green])
    for each, colour in ((red, 'red'), (green, 'green')):
        found = find_drink(image, KITCHEN, FRIDGE, colour=colour)
        assert np.allclose(found.centre, each.position, atol=0.015)
    for colour, words in (
        ('blue', 'no blue drink: there are 2 things on the shelf: red, green'),
        ('pink', "colour is 'pink'; allowed: blue, "),
    ):
        with pytest.raises(NotSeen) as error:
            find_drink(image, KITCHEN, FRIDGE, colour=colour)
        assert words in str(error.value)


def test_its_colour_parts_a_drink_from_one_that_it_touches():
    red, green = drink(0.1, -0.03), drink(0.1, 0.035, colour=(0.12, 0.45, 0.2))
    found = find_drink(image_of([red, green]), KITCHEN, FRIDGE, colour='green')
    assert np.allclose(found.centre, green.position, atol=0.015)


def test_a_drink_that_glare_hides_in_part_is_not_measured():
    image = image_of([drink(0.1, 0.0)])
    place = np.array([drink(0.1, 0.0).position])
    column, row, _ = pixels_of(place, image.intrinsics, image.base_from_camera)[0]
    rows, columns = np.indices(image.depth.shape)
    scale = image.depth.shape[1] / 320
    image.depth[np.hypot(columns - column - 20 * scale, rows - row) < 25 * scale] = np.nan
    assert 'depth is missing in a patch' in reason(image)


def test_colours_have_the_names_that_people_use():
    named = {
        'red': (0.80, 0.15, 0.12),
        'green': (0.12, 0.45, 0.20),
        'orange': (0.90, 0.60, 0.10),
        'blue': (0.15, 0.30, 0.70),
        'purple': (0.60, 0.20, 0.55),
        'yellow': (0.90, 0.75, 0.15),
        'turquoise': (0.10, 0.55, 0.60),
        'grey': (0.92, 0.92, 0.90),
        '': (0.05, 0.01, 0.0),
    }
    for name, colour in named.items():
        assert name_of(255 * np.array(colour)) == name
