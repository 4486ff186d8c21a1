"""The refrigerator's door in a camera image: its angle, and its handle where it is in view."""

from typing import NamedTuple, Optional, Tuple

import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of
from smach_oracle.geometry.transforms import apply, from_rpy, inverse

from ..kitchen import Kitchen, door_frame

COLUMNS = 214  # that are looked at, or all of those of a small image
MOST_OPEN = np.radians(125.0)
STEP = np.radians(1.0)
SLACK = 0.12  # m that the map may be wrong across the door
BIN = 0.01  # m
LEAST_POINTS = 150  # on the door
LEAST_OF_HANDLE = 15


class DoorNotSeen(Exception):
    """The door cannot be made out. The text is the reason, for people."""


class DoorView(NamedTuple):
    """The door as it was seen."""

    angle: float  # rad, against the front of the fridge as the map has it. 0 means closed
    base_from_fridge: np.ndarray  # 4x4, the map's, moved so that the door lies where it was seen


def find_door(image: CameraImage, kitchen: Kitchen, base_from_fridge: np.ndarray) -> DoorView:
    """Make out the door in an image.

    :param base_from_fridge: 4x4, where the map has the fridge, right to some 0.1 m and 5 degrees.
    :raises DoorNotSeen: where no face of the door is in view.
    """
    points = _points_of_door(image, kitchen, base_from_fridge)
    if len(points) < LEAST_POINTS:
        raise DoorNotSeen('the door is not in view: {} points where it may be'.format(len(points)))
    angle, offset, count = _best_angle(points, kitchen, inverse(base_from_fridge)[:3, 3])
    if count < LEAST_POINTS:
        raise DoorNotSeen('no face of the door in view: {} points on the best one'.format(count))
    along = _handle_shift(apply(inverse(door_frame(kitchen, angle)), points), kitchen, offset)
    fridge_from_door = door_frame(kitchen, angle)
    shift = fridge_from_door[:3, :3] @ np.array([offset, along or 0.0, 0.0])
    return DoorView(angle, base_from_fridge @ from_rpy(shift))


def _points_of_door(
    image: CameraImage, kitchen: Kitchen, base_from_fridge: np.ndarray
) -> np.ndarray:
    """(n, 3) points at the handle's height, within the door's swing, in the fridge's frame."""
    stride = image.stride(COLUMNS)
    points = points_of(
        image.depth[::stride, ::stride],
        image.intrinsics,
        inverse(base_from_fridge) @ image.base_from_camera,
        stride=stride,
    ).reshape(-1, 3)
    points = points[np.isfinite(points[:, 2])]
    low, high = kitchen.handle_span
    level = (points[:, 2] > low + 0.02) & (points[:, 2] < high - 0.02)
    from_hinge = points[:, :2] - (0.0, kitchen.width / 2)
    near = np.linalg.norm(from_hinge, axis=1) < kitchen.width + SLACK
    return points[level & near & (points[:, 0] < 0.5 * SLACK)]


def _best_angle(points: np.ndarray, kitchen: Kitchen, eye: np.ndarray) -> Tuple[float, float, int]:
    """The door's angle (rad), its plane's distance (m) beyond the map's, and the points on it.

    The outer face is known by its handle: edges of shelves and walls make planes, too.
    """
    best = (0.0, 0.0, 0)
    bins = np.arange(-SLACK, SLACK + BIN, BIN)
    for angle in np.arange(0.0, MOST_OPEN, STEP):
        door_from_fridge = inverse(door_frame(kitchen, angle))
        local = apply(door_from_fridge, points)
        # the camera sees the outer face of a door that is closed, the inner one of a door that is
        # wide open
        face = kitchen.door_thickness if apply(door_from_fridge, eye)[0] > 0 else 0.0
        on_it = (local[:, 1] > 0.05) & (local[:, 1] < kitchen.width + 0.02)
        offsets = local[on_it, 0] - face
        offsets = offsets[(offsets >= bins[0]) & (offsets <= bins[-1])]  # a histogram sorts them
        counts, edges = np.histogram(offsets, bins=bins)
        pairs = counts[:-1] + counts[1:]
        peak = int(np.argmax(pairs))
        inside = offsets[(offsets >= edges[peak]) & (offsets < edges[peak + 2])]
        if pairs[peak] > best[2] and not (
            face and _handle_shift(local, kitchen, float(np.median(inside))) is None
        ):
            best = (float(angle), float(np.median(inside)), int(pairs[peak]))
    return best


def _handle_shift(local: np.ndarray, kitchen: Kitchen, offset: float) -> Optional[float]:
    """Return how much farther from the hinge the handle is seen than it is in the map, m.

    :param local: (n, 3) points in the door's frame.
    :returns: None where it is not seen.
    """
    out = local[:, 0] - offset - kitchen.door_thickness
    place = kitchen.width - kitchen.handle_inset
    near = (np.abs(out - kitchen.handle_stand_off) < 0.025) & (np.abs(local[:, 1] - place) < SLACK)
    if near.sum() < LEAST_OF_HANDLE:
        return None
    return float(np.median(local[near, 1]) - place)
