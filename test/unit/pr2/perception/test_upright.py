"""Whether what was put down is seen to stand at its place, and to be what was meant."""

import numpy as np
import pytest
from ray_camera import camera_at, see
from worlds import CAN, TABLE

from smach_oracle.geometry.box import UprightBox
from smach_oracle.pr2.kitchen import MapBox
from smach_oracle.pr2.perception.upright import StandingLook, look_of, why_not_standing

PLACE = np.array([0.6, -0.35, CAN.position[2]])
HALF = np.array([0.031, 0.031, 0.06])
AT_PLACE = CAN._replace(position=tuple(PLACE))
BESIDE = CAN._replace(name='beside', position=(0.675, -0.35, CAN.position[2]))
LOW = CAN._replace(name='low', position=(0.6, -0.35, 0.75), size=(0.031, 0.031, 0.06))
TALL = CAN._replace(name='tall', position=(0.6, -0.35, 0.80), size=(0.031, 0.031, 0.16))
RED, BLUE = np.array([204.0, 26.0, 26.0]), np.array([26.0, 76.0, 204.0])


def seen(*bodies):
    return see(
        (TABLE,) + bodies, camera_at((0.09, 0.02, 1.44), PLACE), np.random.default_rng(1), noise=0.0
    ).image


def why_not(*bodies, others=(), **look):
    return why_not_standing(seen(*bodies), PLACE, HALF, others, StandingLook(**look))


def test_what_stands_beside_the_place_is_not_taken_for_the_object():
    box = MapBox(np.array(BESIDE.position), HALF, 0.0)
    assert not why_not(AT_PLACE, BESIDE, others=[box]) and not why_not(AT_PLACE)
    assert why_not(BESIDE, others=[box]) == 'nothing stands at its place'


def test_what_is_not_as_high_as_the_object_lies():
    assert why_not(LOW) == (
        'it lies at its place: what is there is 6 cm high, and the object is 12 cm'
    )


def test_what_is_higher_than_the_object_is_another_thing():
    assert why_not(TALL).startswith('another thing is at its place: that is 16 cm high')


def test_what_leans_does_not_stand():
    """A can that leans by 20 degrees, as slices."""
    slices = [
        CAN._replace(
            name='slice {}'.format(k),
            size=(0.031, 0.031, 0.02),
            position=(0.6, -0.37 + 0.36 * 0.02 * k, PLACE[2] - 0.05 + 0.02 * k),
        )
        for k in range(6)
    ]
    assert why_not(*slices).startswith('it leans at its place')


@pytest.mark.parametrize('colour, stands', [(RED, True), (BLUE, False), (None, True)])
def test_what_has_another_colour_than_the_object_is_another_thing(colour, stands):
    told = why_not(AT_PLACE, colour=colour)
    assert told == (
        '' if stands else 'another thing is at its place: that is red, and the object is blue'
    )


def test_the_looks_of_a_thing_are_its_colour_and_whether_its_top_is_level():
    look = look_of(seen(AT_PLACE), UprightBox(PLACE, 2 * HALF, 0.0))
    assert look.level and look.colour is not None and look.colour.argmax() == 0
    assert look_of(seen(), UprightBox(PLACE, 2 * HALF, 0.0)).colour is None
