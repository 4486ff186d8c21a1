"""Connected points: pieces of a cloud, the largest piece of a surface, what stands on it."""

from typing import List, Optional

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from .outer_points import outer_points
from .plane import Plane

PATCH_CELL = 0.02  # m, of the grid in which a surface is connected
PATCH_SHARE = 0.1  # of the points of the largest piece that another one must have to count
CLUSTER_CELL = 0.01  # m: things closer than this to each other are one piece
LEAST_POINTS = 60  # of a thing
FARTHEST = 6.0  # m from the first corner. Whatever is further away is taken to be there


def piece_labels(points: np.ndarray, cell: float) -> np.ndarray:
    """Return for each of the points (n, 3), n >= 1, the number of its piece, from 1.

    :param cell: m: points in cells that do not touch are in different pieces.
    """
    cells = np.floor(np.minimum(points - points.min(axis=0), FARTHEST) / cell).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, bool)
    grid[tuple(cells.T)] = True
    return ndimage.label(grid, np.ones((3, 3, 3)))[0][tuple(cells.T)]


def largest_piece(points: np.ndarray, cell: float) -> np.ndarray:
    """(n,) bool: which of the points (n, 3), n >= 1, belong to the piece with the most of them."""
    labels = piece_labels(points, cell)
    return labels == np.bincount(labels).argmax()


def largest_patch(points: np.ndarray) -> np.ndarray:
    """The points of the largest connected piece of a level surface, seen from above.

    Pieces that are not small against it count as well: an arm in front of a table parts what is
    seen of the table.

    :param points: (n, 3).
    """
    if not len(points):
        return points
    cells = np.floor(
        np.minimum(points[:, :2] - points[:, :2].min(axis=0), FARTHEST) / PATCH_CELL
    ).astype(int)
    grid = np.zeros(cells.max(axis=0) + 5, bool)
    grid[tuple(cells.T + 2)] = True
    labels = ndimage.label(ndimage.binary_closing(grid, iterations=2), np.ones((3, 3)))[0][
        tuple(cells.T + 2)
    ]
    sizes = np.bincount(labels)
    sizes[0] = 0
    return points[(sizes >= max(1, PATCH_SHARE * sizes.max()))[labels]]


def standing_on(
    points: np.ndarray,
    plane: Plane,
    patch: np.ndarray,
    lowest: float,
    highest: float,
    margin: float,
) -> List[np.ndarray]:
    """Return the things that stand on a surface: for each thing, the indices of its points.

    Few points are taken for noise.

    :param points: (n, 3), m, all finite.
    :param patch: (m, 3) points of the surface. Things stand within its convex hull.
    :param lowest: m above the surface from which points count, up to `highest`.
    :param margin: m that things must stand inside the hull.
    """
    edges = _edges(patch)
    if edges is None:
        return []
    height = plane.height(points)
    above = np.flatnonzero((height > lowest) & (height < highest))
    inside = (points[above, :2] @ edges[:, :2].T + edges[:, 2] < -margin).all(axis=1)
    above = above[inside]
    if not len(above):
        return []
    labels = piece_labels(points[above], CLUSTER_CELL)
    return [above[labels == label] for label in np.flatnonzero(np.bincount(labels) >= LEAST_POINTS)]


def _edges(patch: np.ndarray) -> Optional[np.ndarray]:
    """(n, 3): lines around a patch seen from above, as normal (outwards) and offset."""
    try:
        return ConvexHull(outer_points(patch[:, :2])).equations
    except (QhullError, ValueError):
        return None
