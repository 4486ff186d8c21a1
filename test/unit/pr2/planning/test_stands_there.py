"""Whether what was put down is seen to stand at its place, beside what stands there anyway."""

import numpy as np
from ray_camera import camera_at, see
from worlds import CAN, TABLE

from smach_oracle.pr2.kitchen import MapBox
from smach_oracle.pr2.skills.pick import HeldObject
from smach_oracle.pr2.skills.place import stands_there

PLACE = np.array([0.6, -0.35, CAN.position[2]])
HELD = HeldObject(np.eye(4), np.eye(4), np.array([0.031, 0.031, 0.06]))
BESIDE = CAN._replace(name='beside', position=(0.675, -0.35, CAN.position[2]))
LOW = CAN._replace(name='low', position=(0.6, -0.35, 0.75), size=(0.031, 0.031, 0.06))


def stands(*bodies, others=()):
    image = see(
        (TABLE,) + bodies, camera_at((0.09, 0.02, 1.44), PLACE), np.random.default_rng(1), noise=0.0
    ).image
    return stands_there(image, PLACE, HELD, others)


def test_what_stands_beside_the_place_is_not_taken_for_the_object():
    box = MapBox(np.array(BESIDE.position), np.array([0.031, 0.031, 0.06]), 0.0)
    at_place = CAN._replace(position=tuple(PLACE))
    assert stands(at_place, BESIDE, others=[box]) and stands(at_place)
    assert not stands(BESIDE, others=[box])
    assert stands(BESIDE), 'who does not know of it is taken in'


def test_what_is_not_as_high_as_the_object_does_not_stand():
    assert not stands(LOW)


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
    assert not stands(*slices)
