"""The head camera: what it measures is where things are, and its errors repeat."""

import numpy as np
import pytest
from worlds import CAN, CARTON, TABLE, scene

from smach_oracle.geometry.depth import pixels_of, points_of
from smach_oracle.geometry.transforms import apply, inverse
from smach_oracle.pr2.robot import CAMERA_FRAME
from smach_oracle.simulation.physics import camera
from smach_oracle.simulation.physics.camera import (
    HEIGHT,
    INTRINSICS,
    WIDTH,
    RenderedView,
    noisy_colour,
    noisy_depth,
)
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.pictures.portrait import portrait
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import Body, CameraQuality, RobotStart

BOWED = RobotStart((('head_tilt_joint', 0.9),))


@pytest.fixture(scope='module')
def world():
    one = World(scene())
    yield one
    one.close()


@pytest.fixture(scope='module')
def robot(world):
    world.reset(scene())
    robot = DirectRobot(world)
    robot.look_at((0.72, -0.05, 0.75))
    return robot


def pixels_seen(world):
    """Rows and columns of what the head camera sees now, by the name of the body."""
    bodies = RenderedView(world, world.link_pose(CAMERA_FRAME)).bodies
    return {
        world.seen_as(int(index)): np.nonzero(bodies == index)
        for index in np.unique(bodies[bodies >= 0])
    }


def test_a_noise_free_view_puts_things_where_they_are():
    world = World(scene(Body('box', 'box', (0.2, 0.2, 0.2), (1.5, 0.1, 1.2))))
    pose = world.link_pose(CAMERA_FRAME)
    view = RenderedView(world, pose)
    on_box = np.vectorize(world.seen_as)(view.bodies) == 'box'
    points = points_of(view.depth, INTRINSICS, pose)[on_box]
    front = points[np.abs(points[:, 0] - 1.4) < 0.005]
    assert len(front) > 1000
    for axis, middle in ((1, 0.1), (2, 1.2)):
        assert [front[:, axis].min(), front[:, axis].max()] == pytest.approx(
            [middle - 0.1, middle + 0.1], abs=2e-3
        )
    rows, columns = np.nonzero(on_box)
    corners = pixels_of(np.array([[1.4, 0.2, 1.1], [1.4, 0.0, 1.1]]), INTRINSICS, pose)
    assert [columns.min() - 0.5, columns.max() + 0.5] == pytest.approx(
        sorted(corners[:, 0]), abs=0.6
    )
    assert rows.max() + 0.5 == pytest.approx(corners[0, 1], abs=0.6)
    world.close()


def test_a_frame_is_in_the_frame_of_the_base(world, robot):
    before = world.time
    image = robot.see()
    assert image.stamp == pytest.approx(before + 1 / 30, abs=1e-6)
    assert world.time > image.stamp  # it takes time to process it
    assert image.colour.shape == (HEIGHT, WIDTH, 3) and image.colour.dtype == np.uint8
    assert image.depth.shape == (HEIGHT, WIDTH) and image.depth.dtype == np.float32
    points = points_of(image.depth, image.intrinsics, image.base_from_camera)
    rows, columns = pixels_seen(world)['can']
    can = points[(rows.min() + rows.max() + 1) // 2, (columns.min() + columns.max() + 1) // 2]
    assert np.hypot(*(can[:2] - CAN.position[:2])) == pytest.approx(0.031, abs=0.01)
    table = points[np.abs(points[..., 2] - 0.72) < 0.02]
    assert len(table) > 0.2 * WIDTH * HEIGHT and abs(np.median(table[:, 2]) - 0.72) < 2e-3
    assert apply(inverse(world.true_base()), world.link_pose(CAMERA_FRAME)[:3, 3]) == pytest.approx(
        image.base_from_camera[:3, 3]
    )


def test_noise_repeats_with_the_trial_and_differs_between_frames(world):
    def images():
        world.reset(scene())
        robot = DirectRobot(world)
        return [robot.see(), robot.see()]

    first, again = images(), images()
    for one, other in zip(first, again):
        assert np.array_equal(one.colour, other.colour) and np.array_equal(
            one.depth, other.depth, equal_nan=True
        )
    assert not np.array_equal(first[0].colour, first[1].colour)


def test_noise_is_as_large_as_it_is_said_to_be():
    depth, generator = np.full((200, 200), 1.0, np.float32), np.random.default_rng(0)
    usual, none, fourfold = (
        noisy_depth(depth, CameraQuality(noise=noise), generator) for noise in (1.0, 0.0, 4.0)
    )
    assert np.nanstd(usual) == pytest.approx(0.0012 + 0.0019 * 0.36, rel=0.1)
    assert np.nanstd(fourfold) > 3.5 * np.nanstd(usual) and np.nanstd(none) < 1e-6
    assert np.isnan(usual).mean() == pytest.approx(0.005, abs=0.002)
    assert np.isnan(noisy_depth(depth, CameraQuality(dropout=1.0), generator)).all()
    colour = noisy_colour(
        np.full((200, 200, 3), 128, np.uint8), CameraQuality(colour_noise=6.0), generator
    )
    assert colour.std() == pytest.approx(6.0, abs=0.3)


def test_edges_and_what_is_too_far_are_lost():
    depth = np.full((100, 100), 1.0, np.float32)
    depth[:, 50:] = 1.5
    depth[:10] = camera.FAR
    found = noisy_depth(depth, CameraQuality(), np.random.default_rng(0))
    assert np.isnan(found[:10]).all()
    assert np.isnan(found[20:, 49:51]).mean() > 0.5 > 0.1 > np.isnan(found[20:, 60:]).mean()


def test_dim_light_costs_colour_more_than_depth(world):
    """The depth camera brings its own light."""
    shares, noise = [], []
    for level in (1.0, 0.15):
        world.reset(scene(camera=CameraQuality(brightness=level), robot=BOWED))
        image = DirectRobot(world).see()
        shares.append(np.isnan(image.depth).mean())
        grey = noisy_colour(
            np.full((200, 200, 3), 128, np.uint8),
            CameraQuality(brightness=level),
            np.random.default_rng(0),
        )
        noise.append(grey.std() / grey.mean())
    assert noise[1] > 5 * noise[0]
    assert shares[0] < shares[1] < shares[0] + 0.05


def test_what_is_hidden_is_not_seen(world):
    screen = Body('screen', 'box', (0.02, 0.4, 0.5), (0.55, -0.2, 0.97))
    world.reset(scene(TABLE, CAN, CARTON, screen))
    DirectRobot(world).look_at((0.72, -0.05, 0.75))
    seen = pixels_seen(world)
    assert 'can' not in seen and 'carton' in seen


def test_a_portrait_shows_the_robot_and_is_lit(world):
    world.reset(scene())
    picture = portrait(world, (240, 160))
    assert picture.shape == (160, 240, 3) and picture.dtype == np.uint8
    robot = picture[40:100, 60:130].astype(int)
    assert np.ptp(robot.sum(axis=2)) > 200 and (robot.max(axis=2) > 150).mean() > 0.1
    assert (picture.max(axis=2) < 15).mean() < 0.02  # no black meshes


def test_a_binned_camera_sees_the_same_in_fewer_pixels(world):
    images = []
    for binning in (1, 2):
        world.binning = binning
        try:
            world.reset(scene(camera=CameraQuality(noise=0.0, colour_noise=0.0), robot=BOWED))
            images.append(DirectRobot(world).see())
        finally:
            world.binning = 1
    whole, binned = images
    assert binned.depth.shape == binned.colour.shape[:2] == (HEIGHT // 2, WIDTH // 2)
    # the middle of four pixels has the mean of their depths, except at edges
    fours = whole.depth.reshape(HEIGHT // 2, 2, WIDTH // 2, 2).mean(axis=(1, 3))
    known = np.isfinite(fours) & np.isfinite(binned.depth)
    assert known.mean() > 0.5 and np.median(np.abs(fours - binned.depth)[known]) < 2e-3
    points = [
        points_of(image.depth, image.intrinsics, image.base_from_camera)
        for image in (whole, binned)
    ]
    ends = [np.nanpercentile(each.reshape(-1, 3), [5, 95], axis=0) for each in points]
    assert np.abs(ends[0] - ends[1]).max() < 0.02
    lost = [np.isnan(image.depth).mean() for image in images]
    assert lost[1] == pytest.approx(lost[0], rel=0.25)
