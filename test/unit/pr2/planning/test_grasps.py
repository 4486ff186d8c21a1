"""Which grasps come first, and where things are put down: flat on faces, with room around."""

import numpy as np
import pytest

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import yaw_of
from smach_oracle.pr2.kitchen import MapBox
from smach_oracle.pr2.planning.collision_map import TABLE_ERROR, with_margin
from smach_oracle.pr2.planning.grasps import grasps, others_first
from smach_oracle.pr2.skills.spots import free_spots

CARTON = UprightBox(np.array([0.55, -0.04, 0.785]), np.array([0.068, 0.056, 0.137]), -0.32)
TABLE = MapBox(np.array([0.8, 0.0, 0.7]), np.array([0.35, 0.7, 0.02]), 0.0)


def is_flat(grasp, box):
    """Whether the fingers lie on two faces, within 8 degrees."""
    off = (yaw_of(grasp) - box.yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4
    return abs(off) < np.radians(8)


@pytest.mark.parametrize('yaw', [-1.2, -0.32, 0.4, 0.7])
def test_fingers_lie_flat_on_the_faces_of_a_carton(yaw):
    carton = CARTON._replace(yaw=yaw)
    assert is_flat(grasps(carton, 'right')[0], carton)


def test_what_is_taken_from_above_is_taken_flat_and_near_its_middle():
    found = others_first(grasps(CARTON, 'right'), 1)
    grasp = found[0]
    assert grasp[2, 0] < -0.99, 'the hand points down'
    across = grasp[:2, 1] / np.linalg.norm(grasp[:2, 1])
    turn = float(np.arctan2(across[1], across[0])) - CARTON.yaw
    assert abs((turn + np.pi / 4) % (np.pi / 2) - np.pi / 4) < np.radians(8)
    assert abs(grasp[2, 3] - CARTON.centre[2]) < 0.02


def test_a_can_is_taken_from_the_shoulder_straight_away():
    can = UprightBox(np.array([0.7, -0.2, 0.78]), np.array([0.062, 0.061, 0.12]), 0.0)
    away = np.arctan2(can.centre[1] + 0.19, can.centre[0] + 0.05)
    assert abs(yaw_of(grasps(can, 'right')[0]) - away) < 0.11


def test_a_spot_with_room_around_it_comes_first():
    place, half = np.array([0.6, -0.35, 0.784]), np.array([0.03, 0.03, 0.06])
    near = MapBox(np.array([0.67, -0.35, 0.77]), np.array([0.03, 0.03, 0.05]), 0.0)
    spots, _ = free_spots(place, 0.045, half, {'table': TABLE, 'near': near}, 'table')
    assert spots[0][0] < place[0] - 0.01
    spots, _ = free_spots(place, 0.045, half, {'table': TABLE}, 'table')
    assert spots[0] == pytest.approx(place)


def test_a_table_that_is_seen_too_low_is_planned_around():
    higher = with_margin({'table': TABLE, 'can': MapBox(TABLE.centre, TABLE.half, 0.0)})
    top = higher['table'].centre[2] + higher['table'].half[2]
    assert top == pytest.approx(0.72 + TABLE_ERROR)
    assert higher['table'].centre[2] - higher['table'].half[2] == pytest.approx(0.68)
    assert higher['can'].centre[2] == 0.7
    assert TABLE.half[2] == 0.02
