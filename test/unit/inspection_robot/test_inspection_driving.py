"""Routes keep clear of walls, a scan tells where the robot is, and steering brings it there."""

import math

import numpy as np
import pytest

from smach_oracle.inspection_robot.nodes.transforms import between, joined, pose_message, pose_of
from smach_oracle.inspection_robot.rays import clearance
from smach_oracle.inspection_robot.robot.localisation import LocalisationError, Localiser
from smach_oracle.inspection_robot.robot.route import RouteError, RoutePlanner
from smach_oracle.inspection_robot.robot.steering import Steering, is_blocked
from smach_oracle.inspection_robot.site import PANELS, ROBOT_RADIUS, START, WALLS, before_panel
from smach_oracle.inspection_robot.world.causes import draw
from smach_oracle.inspection_robot.world.inspection_world import (
    BEAMS,
    SCANNER_RANGE,
    InspectionWorld,
)

PLACES = [before_panel(panel, 1.5) for panel in PANELS]
PLANNER = RoutePlanner()


def world_at(pose, *only):
    world = InspectionWorld(draw(3, only=only))
    world.base.pose = pose
    return world


@pytest.mark.parametrize('start', [START] + PLACES, ids=str)
@pytest.mark.parametrize('goal', PLACES, ids=str)
def test_a_route_keeps_clear_of_the_walls(start, goal):
    points = [start[:2]] + PLANNER.legs(start, goal)
    assert points[-1] == pytest.approx(goal[:2])
    for here, there in zip(points, points[1:]):
        for share in np.linspace(0.0, 1.0, 50):
            x, y = np.array(here) + share * (np.array(there) - np.array(here))
            assert clearance(x, y, WALLS) > ROBOT_RADIUS + 0.1


@pytest.mark.parametrize('goal', [(3.5, 2.0), (0.1, 0.1), (40.0, 2.0)])
def test_a_goal_in_a_wall_is_refused(goal):
    with pytest.raises(RouteError, match='in a wall'):
        PLANNER.legs(START, goal)


@pytest.mark.parametrize('seed', range(6))
def test_a_scan_tells_where_the_robot_is(seed):
    rng = np.random.default_rng(seed)
    x, y, yaw = PLACES[seed % 3]
    world = world_at((x + rng.uniform(-0.5, 0.5), y + rng.uniform(-0.3, 0.3), yaw + 0.3))
    true = world.base.pose
    believed = (
        true[0] + rng.uniform(-0.6, 0.6),
        true[1] + rng.uniform(-0.6, 0.6),
        true[2] + rng.uniform(-0.6, 0.6),
    )
    found = Localiser().locate(believed, world.scan(), BEAMS, SCANNER_RANGE)
    assert np.hypot(found[0] - true[0], found[1] - true[1]) < 0.03
    assert abs(math.remainder(found[2] - true[2], 2 * math.pi)) < 0.02


def test_a_scan_that_fits_nowhere_is_told():
    scan = np.full(len(BEAMS), 1.0)
    with pytest.raises(LocalisationError, match='lie on walls'):
        Localiser().locate(PLACES[1], scan, BEAMS, SCANNER_RANGE)
    with pytest.raises(LocalisationError, match='0 points'):
        Localiser().locate(PLACES[1], scan + SCANNER_RANGE, BEAMS, SCANNER_RANGE)


@pytest.mark.parametrize('goal', PLACES, ids=str)
def test_steering_brings_the_robot_to_its_goal(goal):
    world = world_at(START)
    steering = Steering(PLANNER.legs(START, goal), goal[2])
    for _ in range(800):
        command = steering.next(world.base.pose, world.scan(), BEAMS)
        assert not command.blocked
        if command.arrived:
            break
        world.base.command(command.v, command.w)
        world.step(0.05)
    assert command.arrived
    assert math.hypot(world.base.pose[0] - goal[0], world.base.pose[1] - goal[1]) < 0.1


def test_something_on_the_way_blocks_it_and_something_beside_it_does_not():
    angles = np.array([-0.9, 0.0, 0.9])
    assert is_blocked(np.array([3.0, 0.6, 3.0]), angles, 0.75)
    assert not is_blocked(np.array([0.7, 3.0, 0.7]), angles, 0.75)
    steering = Steering([(5.0, 0.0)], 0.0)
    assert steering.next((0.0, 0.0, 0.0), np.array([3.0, 0.6, 3.0]), angles).blocked
    assert not steering.next((0.0, 0.0, 2.0), np.array([3.0, 0.6, 3.0]), angles).blocked


def test_what_is_behind_the_goal_is_not_in_the_way():
    steering = Steering([(0.3, 0.0)], 0.0)
    assert not steering.next((0.0, 0.0, 0.0), np.array([0.6]), np.array([0.0])).blocked


def test_frames_are_joined_and_taken_apart():
    first, second = (1.0, 2.0, 0.7), (-0.4, 3.0, 2.9)
    assert between(joined(first, second), second) == pytest.approx(first)
    assert pose_of(pose_message(second)) == pytest.approx(second)
    message = pose_message(second)
    message.orientation.x = 0.7
    with pytest.raises(ValueError, match='upright'):
        pose_of(message)
