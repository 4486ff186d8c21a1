"""Patches where the camera measured no depth, as glare makes them, in which things may stand."""

from typing import Optional

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.outer_points import outer_points
from smach_oracle.geometry.plane import Plane

from .clusters import COLUMNS, HERE, Cluster

# pixels of an image of COLUMNS columns: less has been lost at the edges of things
NARROWEST = 5
LEAST_PATCH = 150  # of these: a can behind it has some 400
BESIDE = 4  # pixels from a thing within which a patch hides part of it
LEAST_BESIDE = 12  # of these
WHITE = 240  # each of a pixel's three values, of 255, where the light is too bright


def blind_patches(image: CameraImage) -> np.ndarray:
    """(h, w) bool of the thinned image: what lies in a patch without depth."""
    stride = image.stride(COLUMNS)
    depth = image.depth[::stride, ::stride]
    lost = ~(np.isfinite(depth) & (depth > 0))
    wide = ndimage.binary_opening(lost, np.ones((NARROWEST, NARROWEST)))
    labels, count = ndimage.label(wide)
    if not count:
        return np.zeros(depth.shape, bool)
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return np.asarray((sizes >= LEAST_PATCH)[labels])


def dazzled(image: CameraImage) -> bool:
    """Whether light falls into the camera: a patch is white, and has no depth."""
    stride = image.stride(COLUMNS)
    white = image.colour[::stride, ::stride].min(axis=-1) > WHITE
    return int((white & blind_patches(image)).sum()) >= LEAST_PATCH


def blind_distance(
    image: CameraImage, blind: np.ndarray, plane: Plane, patch: np.ndarray, near: np.ndarray = HERE
) -> Optional[float]:
    """m from a point to the nearest place on a surface that is behind a blind patch.

    :param blind: as from blind_patches().
    :param patch: (n, 3) points of the surface.
    :param near: (2,) m or more, the point.
    :returns: None where no such patch lies before the surface.
    """
    rows, columns = np.nonzero(blind)
    if not len(rows):
        return None
    stride = image.stride(COLUMNS)
    rays = (
        np.column_stack(
            [
                (stride * columns - image.intrinsics[0, 2]) / image.intrinsics[0, 0],
                (stride * rows - image.intrinsics[1, 2]) / image.intrinsics[1, 1],
                np.ones(len(rows)),
            ]
        )
        @ image.base_from_camera[:3, :3].T
    )
    eye = image.base_from_camera[:3, 3]
    down = rays @ plane.normal
    meets = down < -1e-6
    scale = np.where(meets, -float(plane.height(eye)) / np.where(meets, down, -1.0), np.inf)
    there = eye[:2] + rays[meets, :2] * scale[meets, None]
    try:
        edges = ConvexHull(outer_points(patch[:, :2])).equations
    except (QhullError, ValueError):
        return None
    there = there[(there @ edges[:, :2].T + edges[:, 2] < 0.0).all(axis=1)]
    if len(there) < LEAST_PATCH:
        return None
    return float(np.percentile(np.hypot(*(there - near[:2]).T), 5))


def blind_beside(blind: np.ndarray, cluster: Cluster) -> bool:
    """Whether a blind patch lies right beside a cluster, and so may hide part of it."""
    own = np.zeros(blind.shape, bool)
    own[tuple(cluster.pixels.T)] = True
    around = ndimage.binary_dilation(own, iterations=BESIDE)
    return bool((around & blind).sum() >= LEAST_BESIDE)
