"""Upright boxes around things that stand on a plane."""

from typing import NamedTuple, Tuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from .outer_points import outer_points
from .transforms import from_rpy

# a footprint whose tightest rectangle has more than this share of the widest one's area has no
# heading
ROUND = 0.86


class UprightBox(NamedTuple):
    """A box that stands upright. Its x axis is turned by `yaw`."""

    centre: np.ndarray  # (3,) m
    # (3,) m, along its own axes. X is not shorter than y, except where it is round
    size: np.ndarray
    yaw: float  # rad, within a quarter turn of 0

    @property
    def matrix(self) -> np.ndarray:
        """4x4: the frame of `centre` from its own."""
        return from_rpy(self.centre, yaw=self.yaw)

    @property
    def narrow(self) -> float:
        """The width (m) that a gripper has to span."""
        return float(min(self.size[:2]))

    @property
    def wide(self) -> float:
        """Its larger horizontal extent, m."""
        return float(max(self.size[:2]))

    def corners(self) -> np.ndarray:
        """(4, 2) m: x and y of its footprint."""
        half = self.size[:2] / 2
        turned = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half
        return turned @ self.matrix[:2, :2].T + self.centre[:2]


def upright_box(points: np.ndarray, floor: float, trim: float = 1.0) -> UprightBox:
    """The tightest upright box around points (n, 3) in m, n >= 1, down to z = `floor`.

    :param trim: per cent of the points that may stick out on each side, as noise does.
    """
    yaw = _heading(points[:, :2])
    along = np.array([np.cos(yaw), np.sin(yaw)])
    across = np.array([-along[1], along[0]])
    middle, extent = _spans(points[:, :2] @ np.column_stack([along, across]), trim)
    top = max(float(np.percentile(points[:, 2], 100 - trim)), floor)
    centre = middle[0] * along + middle[1] * across
    return UprightBox(
        np.array([centre[0], centre[1], (top + floor) / 2]),
        np.array([extent[0], extent[1], top - floor]),
        float(yaw),
    )


def _spans(values: np.ndarray, trim: float) -> Tuple[np.ndarray, np.ndarray]:
    low, high = np.percentile(values, [trim, 100 - trim], axis=0)
    return (low + high) / 2, high - low


def _heading(flat: np.ndarray) -> float:
    """Direction of the longer side of the tightest rectangle, in (-pi/2, pi/2].

    :returns: rad, or 0 for something round.
    """
    flat = outer_points(flat)
    try:
        hull = flat[ConvexHull(flat).vertices] if len(flat) > 3 else flat
    except QhullError:  # all on one line
        hull = flat
    angles = np.linspace(0, np.pi / 2, 45, endpoint=False)
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    widths = np.ptp(hull @ along.T, axis=0)
    depths = np.ptp(hull @ (along @ np.array([[0, 1], [-1, 0]])).T, axis=0)
    areas = widths * depths
    best = int(np.argmin(areas))
    if areas[best] >= ROUND * areas.max():
        return 0.0
    angle = angles[best] + (0.0 if widths[best] >= depths[best] else np.pi / 2)
    return float(angle - np.pi if angle > np.pi / 2 + 1e-9 else angle)
