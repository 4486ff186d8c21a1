"""Finds the points of an object among marked ones, and the upright box around them."""

from typing import NamedTuple, Optional

import numpy as np

from .box import UprightBox, upright_box
from .pieces import largest_piece
from .plane import Plane

CELL = 0.015  # m: points further from each other do not hang together


class MarkedObject(NamedTuple):
    """An object among marked points."""

    box: UprightBox
    chosen: np.ndarray  # (n,) bool: the points that belong to it
    surface: Optional[Plane]  # the one it stands on


def object_above(
    points: np.ndarray, surface: Optional[Plane], clearance: float
) -> Optional[MarkedObject]:
    """The object among points (n, 3), n >= 1, some of which show what is behind it.

    It is the largest connected piece.

    :param surface: what it stands on, where that is known, else it reaches down to its lowest
        points.
    :param clearance: m above the surface. Lower points belong to that.
    :returns: None where no point is left.
    """
    chosen = np.ones(len(points), bool)
    # else it is not below the object
    if surface is not None and np.mean(surface.height(points) > -clearance) > 0.8:
        chosen = surface.height(points) > clearance
    else:
        surface = None
    if not chosen.any():
        return None
    chosen[np.flatnonzero(chosen)[~largest_piece(points[chosen], CELL)]] = False
    own = points[chosen]
    floor = (
        surface.z_at(*own[:, :2].mean(axis=0))
        if surface is not None
        else float(np.percentile(own[:, 2], 2))
    )
    return MarkedObject(upright_box(own, floor), chosen, surface)
