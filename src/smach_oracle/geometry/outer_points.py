"""The points, out of many, that can lie on their convex hull.

A hull of thirty thousand points takes long.
"""

import numpy as np

LEAST = 64  # fewer points are not worth the work
_ANGLES = np.arange(8) * np.pi / 8
_WAYS = np.array([np.cos(_ANGLES), np.sin(_ANGLES)])  # (2, 8)


def outer_points(flat: np.ndarray) -> np.ndarray:
    """The points (n, 2) without those that lie inside a polygon of 16 others: the same hull."""
    if len(flat) < LEAST:
        return flat
    along = flat @ _WAYS
    corners = flat[np.concatenate([along.argmax(axis=0), along.argmin(axis=0)])]
    sides = np.roll(corners, -1, axis=0) - corners  # counterclockwise
    real = (sides != 0).any(axis=1)
    if not real.any():  # all at one place
        return flat
    inwards = np.column_stack([-sides[real, 1], sides[real, 0]])
    bounds = (inwards * corners[real]).sum(axis=1)
    slack = 1e-9 * np.abs(flat).max() * np.abs(inwards).sum(axis=1)
    return flat[~(flat @ inwards.T > bounds + slack).all(axis=1)]
