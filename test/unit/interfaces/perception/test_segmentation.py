"""What a person draws on a frame becomes an object: masks against true pixels, centres against
places, refusals.
"""

import contextlib
import time

import numpy as np
import pytest
from pr2_world import TABLE, places, thing
from ray_camera import camera_at, see

from smach_oracle.interfaces.perception.marked_scene import MarkedSceneError, scene_of
from smach_oracle.interfaces.perception.segmentation import (
    CameraImage,
    SegmentationError,
    Stroke,
    rectangle,
    segment,
)
from smach_oracle.simulation.scenes.scene import Body

CAMERA = camera_at((0.05, 0.03, 1.38), (0.75, 0.0, 0.75))
CAN = Body('can', 'cylinder', (0.03, 0.03, 0.12), (0.75, 0.0, 0.78), colour=(0.1, 0.3, 0.8))


def shown(bodies, seed=0, noise=1.0, colour_noise=6.0):
    """The image, and whose pixel each is."""
    seen = see(bodies, CAMERA, np.random.default_rng(seed), noise, colour_noise)
    return CameraImage(*seen.image), seen.bodies


def region_around(pixels, jitter=(6, 6, 6, 6)):
    rows, columns = np.nonzero(pixels)
    return rectangle(
        columns.min() - jitter[0],
        rows.min() - jitter[1],
        np.ptp(columns) + jitter[0] + jitter[2],
        np.ptp(rows) + jitter[1] + jitter[3],
    )


def overlap(mask, truth):
    return (mask & truth).sum() / (mask | truth).sum()


def refusal(image, region, strokes=()):
    with pytest.raises(SegmentationError) as error:
        segment(image, region, strokes)
    return error.value


@pytest.mark.parametrize('noise, colour_noise', [(1.0, 6.0), (4.0, 6.0), (0.0, 0.0)])
def test_a_drawn_rectangle_gives_the_object(noise, colour_noise):
    overlaps, errors = [], []
    for seed in range(5):
        generator = np.random.default_rng(seed)
        bodies = [TABLE] + [thing(generator, 'thing', *place) for place in places(generator, 2)]
        image, whose = shown(bodies, seed, noise, colour_noise)
        found = segment(image, region_around(whose == 1, generator.integers(2, 12, 4)))
        overlaps.append(overlap(found.mask, whose == 1))
        errors.append(np.linalg.norm(found.box.centre - bodies[1].position))
    assert np.median(overlaps) > 0.97
    assert np.mean(np.array(overlaps) > 0.8) >= 0.8, (
        'something of the colour of the table may be lost'
    )
    assert np.median(errors) < 0.01


@pytest.mark.parametrize('gap', [0.0, 0.02])
def test_neighbours_that_merge_for_a_detection_are_parted(gap):
    for angle in (0.3, 1.5, 2.6):
        beside = (0.75 + (0.06 + gap) * np.cos(angle), (0.06 + gap) * np.sin(angle), 0.78)
        image, whose = shown([TABLE, CAN, CAN._replace(position=beside, colour=(0.8, 0.2, 0.1))])
        found = segment(image, region_around(whose == 1))
        assert overlap(found.mask, whose == 1) > 0.85
        assert np.linalg.norm(found.box.centre - CAN.position) < 0.015


def test_strokes_decide_where_colour_does_not():
    # a can that has the colour of the table
    body = CAN._replace(colour=TABLE.colour, position=(0.75, 0.0, 0.755), size=(0.03, 0.03, 0.07))
    image, whose = shown([TABLE, body])
    truth, region = whose == 1, region_around(whose == 1)
    rows, columns = np.nonzero(truth)
    inside = np.column_stack([columns, rows])[::7].astype(float)
    found = segment(image, region, [Stroke(True, inside, 5.0)])
    assert overlap(found.mask, truth) > 0.7
    assert overlap(found.mask, truth) > overlap(segment(image, region).mask, truth)


def test_a_stroke_takes_away_what_does_not_belong():
    other = CAN._replace(position=(0.75, 0.065, 0.78), colour=(0.8, 0.2, 0.1))
    image, whose = shown([TABLE, CAN, other])
    both = region_around((whose == 1) | (whose == 2))
    rows, columns = np.nonzero(whose == 2)
    line = np.array([[columns.mean(), rows.min() + 3], [columns.mean(), rows.max() - 3]])
    found = segment(image, both, [Stroke(False, line, 14.0)])
    assert overlap(found.mask, whose == 1) > overlap(segment(image, both).mask, whose == 1)
    assert overlap(found.mask, whose == 1) > 0.85


def test_a_polygon_is_a_region_too():
    image, whose = shown([TABLE, CAN])
    left, top = region_around(whose == 1)[0]
    right, bottom = region_around(whose == 1)[2]
    corners = np.array(
        [
            [left, top],
            [right, top],
            [right + 10, (top + bottom) / 2],
            [right, bottom],
            [left, bottom],
        ]
    )
    assert overlap(segment(image, corners).mask, whose == 1) > 0.95


def test_the_same_drawing_gives_the_same_object():
    image, whose = shown([TABLE, CAN])
    one, other = (segment(image, region_around(whose == 1)) for _ in range(2))
    assert np.array_equal(one.mask, other.mask)
    assert np.array_equal(one.box.centre, other.box.centre)


def test_a_region_as_large_as_the_image_does_not_keep_a_person_waiting():
    image, whose = shown([TABLE, CAN])
    begun_s = time.process_time()
    # a person would draw closer: nothing is left for the background
    with contextlib.suppress(SegmentationError):
        segment(image, rectangle(0, 0, 640, 480))
    assert time.process_time() - begun_s < 0.6, 'twice what it should take, for a busy machine'


@pytest.mark.parametrize(
    'region, text',
    [
        (rectangle(700, 10, 50, 50), 'outside the image'),
        (rectangle(10, -90, 50, 50), 'outside the image'),
        (rectangle(100, 100, 1, 80), 'too small'),
        (np.zeros((2, 2)), '3 corners'),
        (np.zeros((4, 3)), '3 corners'),
        (np.full((4, 2), np.nan), 'finite'),
    ],
)
def test_a_region_that_is_none_is_refused(region, text):
    assert text in str(refusal(shown([TABLE, CAN])[0], region))


@pytest.mark.parametrize(
    'stroke, text',
    [
        (Stroke(True, np.zeros((0, 2))), 'a stroke needs'),
        (Stroke(True, np.array([[np.inf, 1.0]])), 'a stroke needs'),
        (Stroke(True, np.array([[1.0, 1.0]]), -3.0), 'width of -3.0'),
    ],
)
def test_a_stroke_that_is_none_is_refused(stroke, text):
    assert text in str(refusal(shown([TABLE, CAN])[0], rectangle(300, 200, 80, 80), [stroke]))


def test_a_mask_that_collapses_is_said_with_what_may_help():
    image, whose = shown([TABLE, CAN])
    rubbed_out = Stroke(False, np.argwhere(whose == 1)[:1, ::-1].astype(float), 400.0)
    assert 'draw a stroke on the object' in str(
        refusal(image, region_around(whose == 1), [rubbed_out])
    )


def test_too_little_depth_is_said_and_the_mask_is_shown():
    image, whose = shown([TABLE, CAN])
    image.depth[whose == 1] = np.nan
    error = refusal(image, region_around(whose == 1))
    assert 'too little depth' in str(error)
    assert overlap(error.mask, whose == 1) > 0.9


def test_the_scene_around_has_the_surface_and_the_other_things():
    others = [
        CAN._replace(position=(0.68, -0.2, 0.78), colour=(0.8, 0.8, 0.1)),
        CAN._replace(position=(0.75, 0.062, 0.78), colour=(0.8, 0.2, 0.1)),
    ]
    image, whose = shown([TABLE, CAN] + others)
    found = scene_of(image, segment(image, region_around(whose == 1)))
    assert abs(found.surface.centre[2] - 0.72) < 0.005
    assert len(found.others) == 2, 'also the one that touches it'
    assert np.linalg.norm(found.others[0].centre - others[0].position) < 0.01


def test_a_thing_in_the_air_has_no_surface():
    image, whose = shown([CAN])
    found = segment(image, region_around(whose == 0))
    with pytest.raises(MarkedSceneError, match='cannot be made out'):
        scene_of(image, found)
