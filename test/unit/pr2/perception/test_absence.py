"""Whether a thing is gone comes from depth alone, from frames whose truth is known to the pixel."""

import numpy as np
import pytest
from pr2_world import TABLE
from ray_camera import camera_at, see

from smach_oracle.geometry.box import UprightBox
from smach_oracle.pr2.perception.absence import sees_past
from smach_oracle.pr2.perception.blind import dazzled
from smach_oracle.simulation.scenes.scene import Body

CAMERA = camera_at((0.05, 0.03, 1.38), (0.75, 0.0, 0.75))
FLOOR = Body('floor', 'box', (3.0, 4.0, 0.02), (2.0, 0.0, -0.01), colour=(0.6, 0.6, 0.6))
WHERE = UprightBox(np.array([0.65, 0.05, 0.78]), np.array([0.06, 0.06, 0.12]), 0.0)


def image_of(*bodies):
    return see([FLOOR, TABLE] + list(bodies), CAMERA, np.random.default_rng(0), 1.0).image


def can(x, y):
    return Body('can', 'cylinder', (0.03, 0.03, 0.12), (x, y, 0.78), colour=(0.1, 0.3, 0.8))


@pytest.mark.parametrize('x, y', [(0.65, 0.05), (0.66, 0.06), (0.64, 0.05)])
def test_what_stands_where_it_was_is_not_gone_though_it_was_measured_a_little_beside(x, y):
    assert not sees_past(image_of(can(x, y)), WHERE)


@pytest.mark.parametrize('bodies', [(), (can(0.71, 0.09),), (can(0.65, 0.13),), (can(0.72, 0.05),)])
def test_what_somebody_has_moved_by_7_cm_or_taken_away_is_gone(bodies):
    assert sees_past(image_of(*bodies), WHERE)


def test_a_place_that_is_hidden_or_not_in_the_image_is_not_known_to_be_empty():
    before = Body('before', 'box', (0.02, 0.3, 0.3), (0.5, 0.05, 0.87))
    assert not sees_past(image_of(before), WHERE)
    assert not sees_past(image_of(), WHERE._replace(centre=np.array([0.65, 2.0, 0.78])))


def test_a_patch_that_is_white_and_has_no_depth_dazzles_and_one_that_is_only_white_does_not():
    image = image_of(can(0.65, 0.05))
    colour, depth = image.colour.copy(), image.depth.copy()
    assert not dazzled(image)
    colour[100:140, 100:140] = 255
    assert not dazzled(image._replace(colour=colour))
    depth[100:140, 100:140] = np.nan
    assert dazzled(image._replace(colour=colour, depth=depth))
    assert not dazzled(image._replace(depth=depth))
