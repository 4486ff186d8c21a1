"""Distances along rays to walls and to round things, in the plane."""

from typing import Sequence, Tuple

import numpy as np

Circle = Tuple[float, float, float]  # x, y, radius in m


def to_walls(origin: Sequence[float], angles: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """(n,) m along each ray to the first wall, or inf where there is none.

    :param angles: (n,) rad, of the rays, in the frame of the origin.
    :param walls: (m, 4) m, both ends of each.
    """
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None, :]
    start = walls[:, :2] - np.asarray(origin[:2], float)
    along = walls[:, 2:] - walls[:, :2]
    across = direction[..., 0] * along[:, 1] - direction[..., 1] * along[:, 0]
    with np.errstate(divide='ignore', invalid='ignore'):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / across
        place = (start[:, 0] * direction[..., 1] - start[:, 1] * direction[..., 0]) / across
    hit = (np.abs(across) > 1e-9) & (distance > 0) & (place >= 0) & (place <= 1)
    return np.where(hit, distance, np.inf).min(axis=1)


def to_circle(origin: Sequence[float], angles: np.ndarray, circle: Circle) -> np.ndarray:
    """(n,) m along each ray to a circle, or inf where it misses. From within it is 0."""
    offset = np.array([circle[0] - origin[0], circle[1] - origin[1]])
    along = offset[0] * np.cos(angles) + offset[1] * np.sin(angles)
    inside = circle[2] ** 2 - (offset @ offset - along**2)
    reached = along - np.sqrt(np.maximum(inside, 0.0))
    return np.where((inside > 0) & (along > 0), np.maximum(reached, 0.0), np.inf)


def ranges(
    origin: Sequence[float], angles: np.ndarray, walls: np.ndarray, circles: Sequence[Circle]
) -> np.ndarray:
    """(n,) m along each ray to the first wall or circle."""
    found = to_walls(origin, angles, walls)
    for circle in circles:
        found = np.minimum(found, to_circle(origin, angles, circle))
    return found


def clearance(x: float, y: float, walls: np.ndarray) -> float:
    """The distance from a point to the nearest wall (m)."""
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    place = ((np.array([x, y]) - start) * along).sum(axis=1) / (along**2).sum(axis=1)
    nearest = start + np.clip(place, 0.0, 1.0)[:, None] * along
    return float(np.hypot(x - nearest[:, 0], y - nearest[:, 1]).min())
