"""The pose of the refrigerator, by all of its faces that a camera image shows."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of
from smach_oracle.geometry.transforms import apply, from_rpy, inverse, yaw_of

from ..kitchen import Kitchen, MapBox, fridge_boxes
from .door_view import DoorNotSeen, DoorView, find_door

COLUMNS = 160  # that are looked at
NEAR = 0.08  # m from a face of the map within which points count
LOOSE = 0.01  # m from a face from which points count less and less
LEAST_POINTS = 400
MOST_POINTS = 800
STARTS = (0.0, -0.05, -0.025, 0.025, 0.05)  # m, along the depth
# rad and m, sigmas of what the robot believed before, and how much that counts: where a door that
# is half open hides the rest, a turn of the fridge and one of its door look the same
BELIEVED, BELIEF = np.array([0.10, 0.10, 0.03]), 0.1
MOST_OFF = 0.008  # m, in the median, from the faces
# a door that is open by less is taken to be shut, unless the fridge had to be turned by more
SHUT, LIKELY = np.radians(8.0), 0.07  # rad
# lowest and highest corner, m, in the fridge's frame, of what is looked at
REGION = (np.array([-0.75, -0.55, 0.25]), np.array([0.55, 0.55, 1.6]))


class FridgeView(NamedTuple):
    """The refrigerator as it was seen."""

    base_from_fridge: np.ndarray  # 4x4
    angle: float  # rad, of its door


def find_fridge(image: CameraImage, kitchen: Kitchen, expected: np.ndarray) -> FridgeView:
    """Fit the map of the refrigerator to an image of its front.

    :param expected: 4x4, base_footprint from fridge, right to some 0.1 m and 5 degrees.
    :raises DoorNotSeen: where its door is not seen, or the map does not fit.
    """
    door = find_door(image, kitchen, expected)
    points = _points_about(image, kitchen, door)
    if len(points) < LEAST_POINTS:
        raise DoorNotSeen(
            'too little of the refrigerator is in view: {} points'.format(len(points))
        )
    found = _fitted(kitchen, points, door, expected, bool(door.angle > SHUT))
    if abs(found.turned) > LIKELY and door.angle <= SHUT:
        found = _fitted(kitchen, points, door, expected, True)  # it stands ajar after all
    if found.median > MOST_OFF:
        raise DoorNotSeen(
            'what is seen of the refrigerator is {:.0f} mm off its map'.format(1000 * found.median)
        )
    return found.view


class _Fit(NamedTuple):
    view: FridgeView
    median: float  # m that points are off the faces
    turned: float  # rad, against what was expected


def _fitted(
    kitchen: Kitchen, points: np.ndarray, door: DoorView, expected: np.ndarray, moves: bool
) -> _Fit:
    """Fit the map to points.

    :param points: (n, 3) m, in the fridge's frame as the door has it.
    :param moves: whether the door's angle is fitted, too, else it is shut.
    """

    def off(values: np.ndarray) -> np.ndarray:
        angle = values[3] if moves else 0.0
        there = apply(inverse(_moved(values)), points)
        boxes = fridge_boxes(kitchen, np.eye(4), float(angle))
        return np.asarray(np.min([np.abs(_distance(there, box)) for box in boxes], axis=0))

    mapped = inverse(door.base_from_fridge) @ expected
    believed = np.array([mapped[0, 3], mapped[1, 3], yaw_of(mapped)])
    weight = BELIEF * LOOSE * np.sqrt(len(points)) / BELIEVED

    def unlikely(values: np.ndarray) -> np.ndarray:
        return np.append(off(values), weight * (values[:3] - believed))

    # thin walls have two faces, and the first fit may take one for the other
    starts = [[x, 0.0, 0.0] for x in (STARTS if moves else (0.0,))]
    starts += [believed.tolist()] * moves
    scale = [0.01, 0.01, 0.01] + [0.02] * moves
    found = min(
        (
            least_squares(
                unlikely,
                start + [door.angle] * moves,
                loss='soft_l1',
                f_scale=LOOSE,
                max_nfev=25,
                x_scale=scale,
            )
            for start in starts
        ),
        key=lambda fit: float(fit.cost),
    )
    view = FridgeView(door.base_from_fridge @ _moved(found.x), float(found.x[3]) if moves else 0.0)
    return _Fit(view, float(np.median(off(found.x))), float(found.x[2] - believed[2]))


def _moved(values: np.ndarray) -> np.ndarray:
    x, y, yaw = (float(each) for each in values[:3])
    return np.asarray(from_rpy((x, y, 0.0), yaw=yaw))


def _points_about(image: CameraImage, kitchen: Kitchen, door: DoorView) -> np.ndarray:
    """(n, 3) points near the faces of the refrigerator, in its frame as the door has it."""
    stride = image.stride(COLUMNS)
    points = points_of(
        image.depth[::stride, ::stride],
        image.intrinsics,
        inverse(door.base_from_fridge) @ image.base_from_camera,
        stride=stride,
    ).reshape(-1, 3)
    with np.errstate(invalid='ignore'):
        points = points[np.all((points > REGION[0]) & (points < REGION[1]), axis=1)]
    boxes = fridge_boxes(kitchen, np.eye(4), door.angle if door.angle > SHUT else 0.0)
    points = points[np.min([np.abs(_distance(points, box)) for box in boxes], axis=0) < NEAR]
    return points[:: max(1, len(points) // MOST_POINTS)]


def _distance(points: np.ndarray, box: MapBox) -> np.ndarray:
    """(n,) m from points (n, 3) to the faces of a box, below 0 inside."""
    away = points - box.centre
    turn = np.array(
        [
            [np.cos(box.yaw), np.sin(box.yaw), 0.0],
            [-np.sin(box.yaw), np.cos(box.yaw), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    beyond = np.abs(away @ turn.T) - box.half
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))
