"""Detection of what stands on a table, from frames whose truth is known to the pixel."""

import re

import numpy as np
import pytest
from pr2_world import TABLE, extents, places, thing
from ray_camera import INTRINSICS, WIDTH, camera_at, see

from smach_oracle.geometry.depth import pixels_of
from smach_oracle.geometry.transforms import transform
from smach_oracle.pr2.nodes.perception_node import told_where_to_look
from smach_oracle.pr2.nodes.skill_server import PartResultError
from smach_oracle.pr2.perception.clusters import Capsule, NotSeen
from smach_oracle.pr2.perception.tabletop import Look, find_tabletop
from smach_oracle.simulation.scenes.scene import Body

CAMERA = camera_at((0.05, 0.03, 1.38), (0.75, 0.0, 0.75))
FLOOR = Body('floor', 'box', (3.0, 4.0, 0.02), (2.0, 0.0, -0.01), colour=(0.6, 0.6, 0.6))
ARM = Capsule('right arm', np.array([0.3, -0.25, 0.95]), np.array([0.62, 0.0, 0.95]), 0.08)


def image_of(bodies, seed=0, noise=1.0, camera=CAMERA):
    return see([FLOOR] + list(bodies), camera, np.random.default_rng(seed), noise).image


def can(x, y, radius=0.03, colour=(0.1, 0.3, 0.8), height=0.12):
    return Body(
        'can', 'cylinder', (radius, radius, height), (x, y, 0.72 + height / 2), colour=colour
    )


def reason(image, **given):
    with pytest.raises(NotSeen) as error:
        find_tabletop(image, **given)
    return str(error.value)


@pytest.mark.parametrize('noise, limit', [(0.0, 0.004), (1.0, 0.007), (4.0, 0.012)])
def test_centres_and_sizes_are_right_to_millimetres(noise, limit):
    errors = []
    for seed in range(3):
        generator = np.random.default_rng(seed)
        bodies = [thing(generator, 'thing', *place) for place in places(generator, 3)]
        found = find_tabletop(image_of([TABLE] + bodies, seed, noise))
        assert len(found.objects) == 3
        for body in bodies:
            box = min(found.objects, key=lambda each: np.linalg.norm(each.centre - body.position))
            errors.append(np.linalg.norm(box.centre - body.position))
            assert np.allclose(
                np.r_[sorted(box.size[:2])[::-1], box.size[2]],
                extents(body),
                atol=0.01 + noise * 0.005,
            )
    assert np.median(errors) < limit
    assert max(errors) < 0.02


def test_objects_come_nearest_first_and_the_table_is_where_it_is():
    found = find_tabletop(image_of([TABLE, can(0.9, 0.2), can(0.65, -0.1), can(0.8, 0.1)]))
    assert [round(float(box.centre[0]), 1) for box in found.objects] == [0.6, 0.8, 0.9]
    assert abs(found.table.centre[2] - 0.72) < 0.005
    assert found.table.size[2] == 0
    assert np.allclose(sorted(found.table.size[:2]), [0.7, 1.2], atol=0.05), (
        'as far as it is in view'
    )


def test_where_the_image_cuts_off_a_nearer_part_of_the_table_it_says_where_to_look():
    wide = TABLE._replace(size=(0.7, 2.4, 0.04))
    assert not find_tabletop(image_of([wide, can(0.55, 0.0), can(0.95, 0.1)])).beyond
    left, right = find_tabletop(image_of([wide, can(0.95, 0.1)])).beyond
    assert left[1] > 0.45 and right[1] < -0.45
    assert all(0.4 < point[0] < 0.8 and abs(point[2] - 0.72) < 0.02 for point in (left, right))


def test_the_box_turns_with_the_object():
    brick = Body(
        'brick', 'box', (0.075, 0.04, 0.1), (0.75, 0.0, 0.77), yaw=0.7, colour=(0.8, 0.2, 0.2)
    )
    box = find_tabletop(image_of([TABLE, brick])).objects[0]
    assert abs(box.yaw - 0.7) < 0.1
    assert box.size[0] > box.size[1]


def test_the_same_frame_is_always_understood_the_same_way():
    image = image_of([TABLE, can(0.7, 0.0), can(0.8, 0.2)])
    one, other = find_tabletop(image), find_tabletop(image)
    assert all(
        np.array_equal(a.centre, b.centre) and a.yaw == b.yaw
        for a, b in zip(one.objects, other.objects)
    )


def test_an_empty_table_is_said_to_be_empty():
    assert 'nothing on the table' in reason(image_of([TABLE]))
    assert 'nothing on the table that stands higher than 15 cm' in reason(
        image_of([TABLE, can(0.7, 0.0)]), min_height=0.15
    )


def test_no_table_is_said_and_so_is_missing_depth():
    assert reason(image_of([])) == 'no table in view'
    image = image_of([TABLE, can(0.7, 0.0)])
    lost = image.depth.copy()
    lost[np.random.default_rng(1).random(lost.shape) < 0.99] = np.nan
    assert 'depth is missing for 99% of the image' in reason(image._replace(depth=lost))
    assert 'depth is missing for 100% of the image' in reason(
        image._replace(depth=np.full_like(lost, np.nan))
    )


def test_half_the_depth_is_enough():
    image = image_of([TABLE, can(0.7, 0.0)])
    image.depth[np.random.default_rng(1).random(image.depth.shape) < 0.5] = np.nan
    assert np.linalg.norm(find_tabletop(image).objects[0].centre - (0.7, 0.0, 0.78)) < 0.01


@pytest.mark.parametrize('gap', [0.0, 0.01])
@pytest.mark.parametrize(
    'colours', [((0.1, 0.3, 0.8), (0.1, 0.3, 0.8)), ((0.8, 0.2, 0.1), (0.2, 0.7, 0.2))]
)
def test_neighbours_that_merge_are_not_taken_for_one_object(gap, colours):
    for seed, angle in enumerate((0.3, 1.2, 2.0)):
        distance = 0.06 + gap
        beside = (0.7 + distance * np.cos(angle), distance * np.sin(angle))
        image = image_of(
            [TABLE, can(0.7, 0.0, colour=colours[0]), can(*beside, colour=colours[1])], seed
        )
        try:
            assert len(find_tabletop(image).objects) == 2, 'told apart'
        except NotSeen as err:
            assert 'several things that touch' in str(err)


def test_boxes_side_by_side_are_told_by_their_colours():
    bricks = [
        Body('brick', 'box', (0.05, 0.05, 0.1), (0.7, y, 0.77), colour=colour)
        for y, colour in ((0.0, (0.8, 0.2, 0.2)), (0.05, (0.2, 0.3, 0.8)))
    ]
    found = find_tabletop(image_of([TABLE] + bricks)).objects
    for box, y in zip(sorted(found, key=lambda each: each.centre[1]), (0.0, 0.05)):
        assert np.allclose(box.centre[:2], (0.7, y), atol=0.008)


def test_three_things_in_a_row_are_told_by_their_colours():
    row = [
        can(0.70 + 0.02 * k, 0.062 * k, colour=colour)
        for k, colour in enumerate(((0.16, 0.55, 0.25), (0.25, 0.8, 0.7), (0.14, 0.35, 0.75)))
    ]
    for seed in range(3):
        found = find_tabletop(image_of([TABLE] + row, seed))
        assert len(found.objects) == 3
        assert all(
            np.linalg.norm(box.centre - body.position) < 0.012
            for box, body in zip(found.objects, row)
        )


def test_nearest_counts_from_where_one_says():
    image = image_of([TABLE, can(0.65, -0.2), can(0.70, 0.2)])
    assert find_tabletop(image).objects[0].centre[1] < 0
    assert find_tabletop(image, near=np.array([0.0, 0.3])).objects[0].centre[1] > 0


def test_what_was_seen_first_is_found_again_though_another_thing_is_nearer_by_now():
    first = find_tabletop(image_of([TABLE, can(0.65, 0.0), can(0.8, 0.2, colour=(0.8, 0.2, 0.1))]))
    seen = Look(first.colours[0], first.objects[0].size)
    swapped = [TABLE, can(0.8, 0.2), can(0.65, 0.0, colour=(0.8, 0.2, 0.1))]
    found = find_tabletop(image_of(swapped, 1), like=seen)
    assert np.allclose(found.objects[0].centre, (0.8, 0.2, 0.78), atol=0.01)
    assert len(found.objects) == 2
    assert re.match(
        'what was seen first, blue and .* x 12 cm, is not among the 1 things on the table: red$',
        reason(image_of([TABLE, swapped[2]]), like=seen),
    )


def test_its_colour_parts_it_from_what_it_touches():
    first = find_tabletop(image_of([TABLE, can(0.65, 0.0)]))
    seen = Look(first.colours[0], first.objects[0].size)
    beside = can(0.7, 0.06, colour=(0.8, 0.2, 0.1))
    found = find_tabletop(image_of([TABLE, can(0.7, 0.0), beside], 2), like=seen)
    assert np.allclose(found.objects[0].centre, (0.7, 0.0, 0.78), atol=0.012)


@pytest.mark.parametrize('beside', [0, 18])
def test_a_thing_that_a_patch_without_depth_hides_in_part_is_not_measured(beside):
    image = image_of([TABLE, can(0.65, 0.0), can(0.9, 0.2)])
    column, row, _ = pixels_of(np.array([[0.65, 0.0, 0.78]]), image.intrinsics, CAMERA)[0]
    rows, columns = np.indices(image.depth.shape)
    scale = WIDTH / 320
    image.depth[np.hypot(columns - column - beside * scale, rows - row) < 25 * scale] = np.nan
    assert 'depth is missing in a patch of the image, before the table' in reason(image)


def test_what_is_cut_off_says_where_to_look():
    camera = camera_at((0.05, 0.03, 1.38), (0.75, 0.0, 0.75))
    with pytest.raises(NotSeen, match='cut off') as error:
        find_tabletop(image_of([TABLE, can(0.6, 0.42), can(0.9, 0.0)], camera=camera))
    assert error.value.where[1] > 0.3


def test_what_is_too_large_for_the_gripper_is_said_with_its_size():
    drum = Body('drum', 'cylinder', (0.07, 0.07, 0.1), (0.7, 0.0, 0.77))
    assert re.search(
        'too large for the gripper, 1[34] x 1[34] x 10 cm', reason(image_of([TABLE, drum]))
    )
    behind = drum._replace(position=(0.95, 0.2, 0.77))
    assert len(find_tabletop(image_of([TABLE, can(0.65, 0.0), behind])).objects) == 2, (
        'only the nearest must fit'
    )


def test_what_lies_is_told_to_lie_and_not_taken_for_what_stood():
    stood = Body('carton', 'box', (0.06, 0.05, 0.13), (0.7, 0.0, 0.785), colour=(0.1, 0.3, 0.8))
    lies = stood._replace(size=(0.06, 0.13, 0.05), position=(0.7, 0.1, 0.745))
    seen = find_tabletop(image_of([TABLE, stood]))
    like = Look(seen.colours[0], seen.objects[0].size)
    told = reason(image_of([TABLE, lies, can(0.6, -0.1, colour=(0.8, 0.1, 0.1))]), like=like)
    assert 'lies on the table at x 0.70, y 0.10 m: the hand takes only what stands' in told


def test_an_arm_that_is_not_known_of_is_no_object():
    beam = Body('beam', 'box', (0.5, 0.1, 0.1), (0.7, 0.0, 0.95), yaw=0.6)
    assert 'is an arm in the view?' in reason(image_of([TABLE, can(0.9, 0.25), beam]))


def arm_body():
    middle, along = (ARM.start + ARM.end) / 2, ARM.end - ARM.start
    yaw = float(np.arctan2(along[1], along[0]))
    return Body('arm', 'box', (np.linalg.norm(along), 0.1, 0.1), tuple(middle), yaw=yaw)


def test_the_robot_takes_its_own_arm_out_of_what_it_sees():
    found = find_tabletop(image_of([TABLE, can(0.85, 0.28), arm_body()]), limbs=[ARM])
    assert len(found.objects) == 1
    assert np.linalg.norm(found.objects[0].centre - (0.85, 0.28, 0.78)) < 0.01


def test_what_an_arm_hides_in_part_is_not_measured():
    text = reason(image_of([TABLE, can(0.78, -0.03), arm_body()]), limbs=[ARM])
    assert text in (
        'the right arm hides part of the nearest object',
        'there is nothing on the table that stands '
        'higher than 2 cm; the right arm covers {}'.format(text.rpartition('covers ')[2]),
    )


def test_what_the_edge_of_the_image_cuts_off_is_not_measured():
    body = can(0.78, 0.0)
    cameras = (camera_at((0.05, 0.03, 1.38), (0.75, y, 0.75)) for y in np.arange(0.3, 1.0, 0.01))
    aside = next(
        camera
        for camera in cameras
        if pixels_of([body.position], INTRINSICS, camera)[0, 0] > WIDTH - 8
    )
    assert 'cut off by the edge' in reason(image_of([TABLE, body], camera=aside))


def test_where_to_look_is_said_in_the_odometry_so_that_the_robot_may_drive():
    stands = transform((0.0, 0.3, 0.0))
    with pytest.raises(PartResultError) as error:
        with told_where_to_look(image_of([TABLE]), stands):
            raise NotSeen('cut off', np.array([0.5, 0.1, 0.7]))
    target = error.value.fields['look_at']
    assert target.header.frame_id == 'odom_combined'
    assert (target.point.x, target.point.y, target.point.z) == pytest.approx((0.5, 0.4, 0.7))
