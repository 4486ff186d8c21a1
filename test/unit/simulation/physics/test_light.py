"""Light that spoils the camera's images: for a time, and in a place."""

import numpy as np
import pytest
from worlds import CAN, scene

from smach_oracle.geometry.depth import pixels_of
from smach_oracle.geometry.transforms import inverse
from smach_oracle.pr2.robot import CAMERA_FRAME
from smach_oracle.simulation.physics.camera import INTRINSICS
from smach_oracle.simulation.physics.passing import pass_time
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.light_causes import dazzling
from smach_oracle.simulation.scenes.scene import Disturbance

LOOK = (0.72, -0.05, 0.75)


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def looking(world, *disturbances, at=LOOK):
    world.reset(scene(disturbances=disturbances))
    robot = DirectRobot(world)
    robot.look_at(at)
    return robot


def glare(world, **more):
    """One that hides the can from where the head looks at the table; it begins after an image."""
    looking(world)
    camera = world.link_pose(CAMERA_FRAME)
    values = dict(
        dazzling(
            camera[:3, 3],
            camera[:3, 3] + camera[:3, 2],
            np.array(CAN.position),
            np.random.default_rng(1),
        ),
        radius=0.15,
        duration=30.0,
        **more,
    )
    return Disturbance('glare', 'see', tuple(values.items()))


def at_can(world, image):
    """Colour and depth about the middle of the can, (n, 3) and (n,)."""
    camera_from_world = inverse(world.link_pose(CAMERA_FRAME))
    column, row, _ = pixels_of(np.array([CAN.position]), INTRINSICS, inverse(camera_from_world))[0]
    rows, columns = (slice(int(each) - 8, int(each) + 9) for each in (row, column))
    return image.colour[rows, columns].reshape(-1, 3), image.depth[rows, columns].ravel()


def lost_at_can(world, image):
    """The share of the can's depth that is lost, and whether its colour is."""
    colour, depth = at_can(world, image)
    return np.isnan(depth).mean(), bool((colour.min(axis=1) > 240).mean() > 0.8)


def test_glare_hides_a_thing_in_depth_and_colour_until_it_ends(world):
    robot = looking(world, glare(world))
    assert lost_at_can(world, robot.see()) == (pytest.approx(0.0, abs=0.2), False)
    for _ in range(3):  # to look again does not help
        share, white = lost_at_can(world, robot.see())
        assert share > 0.9 and white
    assert np.isnan(robot.see().depth).mean() < 0.5  # it is a patch
    pass_time(world, 30 * 60)
    assert lost_at_can(world, robot.see()) == (pytest.approx(0.0, abs=0.2), False)


@pytest.mark.parametrize('elsewhere', ['head', 'base', 'torso'])
def test_from_elsewhere_the_thing_is_seen(world, elsewhere):
    robot = looking(world, glare(world, lobe=0.08))
    robot.see()
    assert lost_at_can(world, robot.see())[0] > 0.9
    if elsewhere == 'head':
        robot.look_at((0.72, -0.35, 0.75))
    elif elsewhere == 'base':
        away = np.eye(4)
        away[1, 3] = 0.25
        robot.drive(away)
        robot.look_at((LOOK[0], LOOK[1] - 0.25, LOOK[2]))
    else:
        robot.torso(0.02)
        robot.look_at(LOOK)
    share, white = lost_at_can(world, robot.see())
    assert share < 0.3 and not white


def test_a_shadow_passes_by_itself_and_a_cloud_stays(world):
    def light(seconds):
        dim = Disturbance('dim', 'see', (('brightness', 0.3), ('duration', seconds)))
        robot = looking(world, dim)
        found = [robot.see().colour.mean() for _ in range(2)]
        pass_time(world, 5 * 60)
        return found + [robot.see().colour.mean()]

    lit, dark, after = light(4.0)
    assert dark < 0.4 * lit and after > 0.9 * lit
    lit, dark, after = light(300.0)
    assert max(dark, after) < 0.4 * lit


def test_a_delay_is_kept_in_the_worlds_time(world):
    dim = Disturbance('dim', 'see', (('brightness', 0.3), ('duration', 60.0), ('delay', 20.0)))
    nudge = Disturbance('nudge:can', 'see', (('dx', 0.06), ('delay', 30.0)))
    robot, light = looking(world, dim, nudge), []
    for seconds in (0, 10, 15, 15):
        pass_time(world, seconds * 60)
        light.append(robot.see().colour.mean())
        moved = world.body_pose('can')[0, 3] - CAN.position[0]
        assert moved == pytest.approx(0.06 if seconds == 15 and len(light) == 4 else 0.0, abs=0.01)
    assert min(light[:2]) > 2 * max(light[2:])
