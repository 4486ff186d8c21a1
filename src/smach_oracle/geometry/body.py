"""Of points that were marked as one object: those that are, and the upright box around them."""
from typing import NamedTuple, Optional

import numpy as np
from scipy import ndimage

from .box import UprightBox, upright_box
from .plane import Plane

CELL = 0.015  # m: points further from each other do not hang together


class Body(NamedTuple):
    """An object among marked points."""

    box: UprightBox
    chosen: np.ndarray  # (n,) bool: the points that belong to it


def body_above(points: np.ndarray, surface: Optional[Plane], clearance: float) -> Optional[Body]:
    """The largest piece that hangs together of points (n, 3), n >= 1, which are the object and some of what is behind it.

    :param surface: what it stands on, where that is known; else it reaches down to its lowest points.
    :param clearance: m above the surface; lower points belong to that.
    :returns: None where no point is left.
    """
    chosen = np.ones(len(points), bool)
    if surface is not None and np.mean(surface.height(points) > -clearance) > 0.8:  # else it is not below the object
        chosen = surface.height(points) > clearance
    else:
        surface = None
    if not chosen.any():
        return None
    chosen[np.flatnonzero(chosen)[~largest_piece(points[chosen])]] = False
    own = points[chosen]
    floor = (surface.z_at(*own[:, :2].mean(axis=0)) if surface is not None
             else float(np.percentile(own[:, 2], 2)))
    return Body(upright_box(own, floor), chosen)


def largest_piece(points: np.ndarray, cell: float = CELL) -> np.ndarray:
    """(n,) bool: which of the points (n, 3), n >= 1, belong to the piece with the most of them."""
    cells = np.floor((points - points.min(axis=0)) / cell).astype(int)
    span = np.minimum(cells, 400)  # 6 m: whatever is further off is not the object
    grid = np.zeros(span.max(axis=0) + 1, bool)
    grid[tuple(span.T)] = True
    labels = ndimage.label(grid, np.ones((3, 3, 3)))[0][tuple(span.T)]
    return labels == np.bincount(labels).argmax()
