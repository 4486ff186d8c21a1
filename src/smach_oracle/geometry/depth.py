"""Between a depth image and points, for a pinhole camera.

Its frame: z forward, x right, y down. A pixel's coordinates (u, v) are those of its centre.
"""

from typing import Tuple

import numpy as np

from .transforms import apply, inverse


def points_of(
    depth: np.ndarray,
    intrinsics: np.ndarray,
    target_from_camera: np.ndarray,
    corner: Tuple[int, int] = (0, 0),
    stride: int = 1,
) -> np.ndarray:
    """(h, w, 3) points in m of a depth image (h, w), NaN where it measured nothing.

    :param corner: column and row of the depth image's first pixel in the image that `intrinsics`
        (3, 3) belongs to.
    :param stride: every so many pixels, of `depth`, is one of its rows and columns.
    """
    rows, columns = np.indices(depth.shape)
    across = (corner[0] + stride * columns - intrinsics[0, 2]) / intrinsics[0, 0]
    down = (corner[1] + stride * rows - intrinsics[1, 2]) / intrinsics[1, 1]
    known = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan).astype(float)
    return apply(target_from_camera, np.stack([across * known, down * known, known], axis=-1))


def pixels_of(
    points: np.ndarray, intrinsics: np.ndarray, target_from_camera: np.ndarray
) -> np.ndarray:
    """(n, 3): column, row and depth (m) at which points (n, 3) appear.

    A depth of 0 or less is behind the camera.
    """
    seen = apply(inverse(target_from_camera), np.asarray(points, float))
    depth = np.where(np.abs(seen[:, 2]) < 1e-9, 1e-9, seen[:, 2])
    return np.column_stack(
        [
            intrinsics[0, 0] * seen[:, 0] / depth + intrinsics[0, 2],
            intrinsics[1, 1] * seen[:, 1] / depth + intrinsics[1, 2],
            seen[:, 2],
        ]
    )
