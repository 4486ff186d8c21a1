"""The robot's pose, from one scan and the plan: the one at which the scan lies on the walls."""

import math
from typing import Tuple

import numpy as np
from scipy.optimize import least_squares

from ..site import SIZE, WALLS, Pose, wrapped

SEARCH_M = 0.9  # around the pose that is believed
SEARCH_RAD = 0.8
CELL = 0.05  # m, of the grid of distances
BORDER = 1.0  # m around the hall
FITS = 0.05  # m off a wall: a point that belongs to it
LEAST_SHARE = 0.6  # of the points must fit: the others are people
SOFT = 0.05  # m: what lies off by more counts less and less


class LocalisationError(Exception):
    """The scan fits nowhere. The text says how well it does."""


def _wall_distances(points: np.ndarray) -> np.ndarray:
    """(...,) m from each point (..., 2) to the nearest wall."""
    start, along = WALLS[:, :2], WALLS[:, 2:] - WALLS[:, :2]
    offset = points[..., None, :] - start
    place = np.clip((offset * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    nearest = start + place[..., None] * along
    return np.linalg.norm(points[..., None, :] - nearest, axis=-1).min(axis=-1)


class Localiser:
    """Holds the distances to the walls, which take a moment to make."""

    def __init__(self) -> None:
        self._shape = tuple(int((size + 2 * BORDER) / CELL) for size in SIZE)
        i, j = np.mgrid[0 : self._shape[0], 0 : self._shape[1]]
        middles = np.stack([i, j], axis=-1) * CELL - BORDER
        self._distances = np.concatenate([_wall_distances(part) for part in middles[:, None]])

    def locate(
        self, believed: Pose, ranges: np.ndarray, angles: np.ndarray, longest: float
    ) -> Pose:
        """The pose in the map.

        :param believed: the search goes SEARCH_M and SEARCH_RAD around it.
        :param ranges: (n,) m along each ray.
        :param angles: (n,) rad of the rays, to the left from straight ahead.
        :param longest: m. What is as far as that is no wall.
        :raises LocalisationError: where too few points lie on walls.
        """
        seen = np.isfinite(ranges) & (ranges < longest)
        points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)[seen]
        if len(points) < 10:
            raise LocalisationError('the scan shows {} points only'.format(len(points)))
        pose = self._refined(self._searched(believed, points), points)
        share = float((_wall_distances(_placed(pose, points)) < FITS).mean())
        if share < LEAST_SHARE:
            raise LocalisationError('{:.0f}% of the scan lie on walls'.format(100 * share))
        return pose

    def _searched(self, believed: Pose, points: np.ndarray) -> Pose:
        """The best of a grid of poses."""
        shifts = np.arange(-SEARCH_M, SEARCH_M + 0.01, 0.15)
        best: Tuple[float, Pose] = (math.inf, believed)
        for turn in np.arange(-SEARCH_RAD, SEARCH_RAD + 0.01, 0.08):
            placed = _placed((believed[0], believed[1], believed[2] + turn), points)
            moved = (
                placed[None, None]
                + np.stack(np.meshgrid(shifts, shifts, indexing='ij'), axis=-1)[:, :, None]
            )
            cost = np.minimum(self._looked_up(moved), 0.3).mean(axis=-1)
            i, j = np.unravel_index(int(np.argmin(cost)), cost.shape)
            if cost[i, j] < best[0]:
                best = (
                    float(cost[i, j]),
                    (
                        believed[0] + float(shifts[i]),
                        believed[1] + float(shifts[j]),
                        believed[2] + float(turn),
                    ),
                )
        return best[1]

    def _looked_up(self, points: np.ndarray) -> np.ndarray:
        index = np.rint((points + BORDER) / CELL).astype(int)
        i = np.clip(index[..., 0], 0, self._shape[0] - 1)
        j = np.clip(index[..., 1], 0, self._shape[1] - 1)
        return self._distances[i, j]

    @staticmethod
    def _refined(pose: Pose, points: np.ndarray) -> Pose:
        found = least_squares(
            lambda each: _wall_distances(_placed(each, points)), pose, loss='soft_l1', f_scale=SOFT
        ).x
        return float(found[0]), float(found[1]), wrapped(float(found[2]))


def _placed(pose: Pose, points: np.ndarray) -> np.ndarray:
    """(n, 2): points of the robot's frame in the map."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return points @ np.array([[cosine, sine], [-sine, cosine]]) + np.array(pose[:2])
