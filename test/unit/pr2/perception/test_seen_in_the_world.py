"""Detection and segmentation on what the simulated PR2's camera sees, against the physical
truth.
"""

import numpy as np
import pytest
from pr2_world import TABLE, TOP, look, places, thing

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.joints import read_joints
from smach_oracle.interfaces.perception.segmentation import rectangle, segment
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.perception.clusters import NotSeen
from smach_oracle.pr2.perception.own_limbs import limbs_of
from smach_oracle.pr2.perception.tabletop import find_tabletop
from smach_oracle.pr2.planning.collision_map import map_of_image
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.scene import Body

# the right hand in front of the camera, over the table
IN_VIEW = tuple(
    zip(
        (
            'r_shoulder_pan_joint',
            'r_shoulder_lift_joint',
            'r_upper_arm_roll_joint',
            'r_elbow_flex_joint',
            'r_forearm_roll_joint',
            'r_wrist_flex_joint',
            'r_wrist_roll_joint',
        ),
        (0.25, 0.5, -0.3, -1.3, 0.0, -0.5, 0.0),
    )
)
# the right arm drawn back from a place at which the camera looks: it sees the shoulder
DRAWN_BACK = (0.443, 0.812, -0.506, -1.476, 2.165, -1.277, -2.158)
MIRRORED = (-1, 1, -1, 1, -1, 1, -1)
PLACE = (0.6, -0.35, 0.8)


@pytest.fixture(scope='module', params=[1, 2], ids=['whole', 'binned'])
def world(request):
    made = World(binning=request.param)
    yield made
    made.close()


@pytest.fixture(scope='module')
def links():
    return read_joints(pr2_urdf().read_text())


def scenes(count, things=3):
    """Seeds with their bodies."""
    for seed in range(count):
        generator = np.random.default_rng(seed)
        yield (
            seed,
            [
                thing(generator, 'thing_{}'.format(k), *place)
                for k, place in enumerate(places(generator, things))
            ],
        )


def errors_of(boxes, seen, bodies):
    """m, of each body's centre to the nearest box."""
    return [
        min(np.linalg.norm(box.centre - seen.bodies[body.name][:3, 3]) for box in boxes)
        for body in bodies
    ]


def test_fifteen_scenes_are_measured_to_a_centimetre(world, links):
    errors, overlaps, marked = [], [], []
    for seed, bodies in scenes(15):
        seen = look(world, [TABLE] + bodies, seed)
        found = find_tabletop(seen.image, limbs=limbs_of(links, seen.joints))
        assert len(found.objects) == len(bodies)
        assert abs(found.table.centre[2] - TOP) < 0.01
        errors += errors_of(found.objects, seen, bodies)
        truth = seen.pixels[bodies[0].name]
        rows, columns = np.nonzero(truth)
        cut = segment(
            CameraImage(*seen.image),
            rectangle(columns.min() - 7, rows.min() - 5, np.ptp(columns) + 12, np.ptp(rows) + 13),
        )
        overlaps.append((cut.mask & truth).sum() / (cut.mask | truth).sum())
        marked += errors_of([cut.box], seen, bodies[:1])
    assert np.median(errors) < 0.007
    assert max(errors) < 0.015
    assert np.median(overlaps) > 0.95
    assert np.median(marked) < 0.01


def test_four_times_the_noise_costs_millimetres_or_is_a_failure_with_a_reason(world, links):
    errors, reasons = [], []
    for seed, bodies in scenes(4):
        seen = look(world, [TABLE] + bodies, seed, noise=4.0)
        try:
            errors += errors_of(
                find_tabletop(seen.image, limbs=limbs_of(links, seen.joints)).objects, seen, bodies
            )
        except NotSeen as err:
            reasons.append(str(err))
    assert all(reasons)
    assert len(errors) >= 6
    assert np.median(errors) < 0.012


def brick(y):
    return Body(
        'brick', 'box', (0.05, 0.05, 0.12), (0.82, y, TOP + 0.06), mass=0.3, colour=(0.2, 0.7, 0.2)
    )


def test_the_robot_knows_its_own_arm_when_it_sees_it(world, links):
    # the arm parts what is seen of the table; the thing stands clear of it, on the smaller part
    seen = look(world, [TABLE, brick(0.34)], joints=IN_VIEW)
    with pytest.raises(NotSeen):  # without its joints it would take the arm for a thing
        find_tabletop(seen.image)
    boxes = find_tabletop(seen.image, limbs=limbs_of(links, seen.joints)).objects
    assert len(boxes) == 1
    assert errors_of(boxes, seen, [brick(0.34)])[0] < 0.01


@pytest.mark.parametrize('arm', ['right', 'left'])
def test_its_own_shoulder_is_nothing_in_the_way(world, links, arm):
    signs = MIRRORED if arm == 'left' else np.ones(7)
    posture = [
        (arm[0] + name[1:], sign * angle)
        for (name, _), sign, angle in zip(IN_VIEW, signs, DRAWN_BACK)
    ]
    place = (PLACE[0], PLACE[1] * signs[0], PLACE[2])
    seen = look(world, [TABLE], joints=[('torso_lift_joint', 0.22), *posture], at=place)

    def nearest(limbs):
        boxes = map_of_image(seen.image, limbs).boxes.values()
        return min(box.centre[0] for box in boxes)

    assert nearest(()) < 0.25  # m before the base. The table begins at 0.5
    assert nearest(limbs_of(links, seen.joints)) > 0.4


def test_what_its_own_hand_hides_in_part_is_not_measured(world, links):
    seen = look(world, [TABLE, brick(0.25)], joints=IN_VIEW)
    with pytest.raises(NotSeen, match='the right arm hides part of the nearest object'):
        find_tabletop(seen.image, limbs=limbs_of(links, seen.joints))
