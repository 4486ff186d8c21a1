"""What stands on a level surface in a camera frame: the surface, and the clusters of points above it."""
import zlib
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from ...geometry.box import UprightBox, upright_box
from ...geometry.depth import points_of
from ...geometry.plane import Plane
from .interface import Frame

STRIDE = 2  # every second row and column: a quarter of the work, and objects still have hundreds of points
CELL = 0.01  # m: things closer than this to each other are one cluster
PATCH_CELL = 0.02  # m, of the grid in which the surface is connected
LEAST_POINTS = 60  # of a cluster
MARGIN = 0.01  # m that things must stand inside the edge of the surface


class NotSeen(Exception):
    """What was looked for cannot be made out in the frame; the text is the reason, for people."""


class Capsule(NamedTuple):
    """A part of the robot's own body: everything within `radius` of a line."""

    name: str  # of the limb, for people
    start: np.ndarray  # (3,) m, in the frame of the base
    end: np.ndarray  # (3,)
    radius: float  # m


class View(NamedTuple):
    """A frame as points in the frame of the base, thinned out."""

    points: np.ndarray  # (h, w, 3) m, NaN where nothing was measured or where the robot sees itself
    colour: np.ndarray  # (h, w, 3) uint8
    hidden: np.ndarray  # (h, w) index of the limb seen there, -1 for none
    limbs: Tuple[str, ...]  # names of the limbs
    known: float  # share of the pixels that have a depth


class Cluster(NamedTuple):
    """Points that hang together."""

    points: np.ndarray  # (n, 3) m
    pixels: np.ndarray  # (n, 2) row and column in the view
    box: UprightBox  # down to the surface


def view_of(frame: Frame, limbs: Sequence[Capsule] = (), reach: float = 2.5) -> View:
    """The points of a frame within `reach` m of depth, without those of the robot's own limbs."""
    depth = frame.depth[::STRIDE, ::STRIDE]
    measured = np.isfinite(depth) & (depth > 0)
    near = np.where(measured & (depth < reach), depth, np.nan)
    points = points_of(near, frame.intrinsics, frame.base_from_camera, stride=STRIDE)
    hidden = np.full(depth.shape, -1)
    for index, limb in enumerate(limbs):
        hidden[_distance(points, limb) < limb.radius] = index
    points[hidden >= 0] = np.nan
    return View(points, frame.colour[::STRIDE, ::STRIDE], hidden, tuple(limb.name for limb in limbs),
                float(measured.mean()))


def generator_of(frame: Frame) -> np.random.Generator:
    """Random numbers that depend on nothing but what was seen: the same frame is always understood the same way."""
    return np.random.default_rng(zlib.crc32(np.ascontiguousarray(frame.depth).tobytes()))


def largest_patch(points: np.ndarray) -> np.ndarray:
    """Those of the points (n, 3) of a level surface that belong to its largest connected piece, seen from above."""
    cells = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / PATCH_CELL).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, bool)
    grid[tuple(cells.T)] = True
    labels, count = ndimage.label(ndimage.binary_closing(np.pad(grid, 2), iterations=2)[2:-2, 2:-2], np.ones((3, 3)))
    if count == 0:
        return points[:0]
    of_point = labels[tuple(cells.T)]
    sizes = np.bincount(of_point, minlength=count + 1)
    sizes[0] = 0
    return points[of_point == np.argmax(sizes)]


def clusters_on(view: View, plane: Plane, patch: np.ndarray, lowest: float, highest: float,
                margin: float = MARGIN) -> List[Cluster]:
    """The clusters above a surface, in no order; a small one is taken for noise.

    :param patch: (n, 3) points of the surface; clusters stand within its convex hull.
    :param lowest: m above the surface from which points count, up to `highest`.
    """
    edges = _edges(patch)
    if edges is None:
        return []
    seen = np.isfinite(view.points[..., 2])
    points, pixels = view.points[seen], np.argwhere(seen)
    height = plane.height(points)
    inside = (points[:, :2] @ edges[:, :2].T + edges[:, 2] < -margin).all(axis=1)
    above = inside & (height > lowest) & (height < highest)
    points, pixels = points[above], pixels[above]
    if not len(points):
        return []
    labels = _labels(points)
    found = []
    for label in np.flatnonzero(np.bincount(labels) >= LEAST_POINTS):
        own = points[labels == label]
        floor = plane.z_at(*own[:, :2].mean(axis=0))
        found.append(Cluster(own, pixels[labels == label], upright_box(own, floor)))
    return found


def limb_beside(view: View, cluster: Cluster) -> Optional[str]:
    """The limb that is seen right beside a cluster and so hides part of it, or None."""
    own = np.zeros(view.hidden.shape, bool)
    own[tuple(cluster.pixels.T)] = True
    around = ndimage.binary_dilation(own, iterations=4)
    limbs = view.hidden[around & (view.hidden >= 0)]
    return view.limbs[np.bincount(limbs).argmax()] if len(limbs) >= 8 else None


def cut_off(view: View, cluster: Cluster) -> bool:
    """Whether the edge of the image cuts a cluster off."""
    height, width = view.hidden.shape
    rows, columns = cluster.pixels.T
    return bool(rows.min() < 2 or columns.min() < 2 or rows.max() > height - 3 or columns.max() > width - 3)


def _distance(points: np.ndarray, limb: Capsule) -> np.ndarray:
    axis = limb.end - limb.start
    length = float(axis @ axis)
    along = np.clip((points - limb.start) @ axis / length, 0.0, 1.0) if length > 1e-9 else np.zeros(points.shape[:-1])
    distance = np.linalg.norm(points - limb.start - along[..., None] * axis, axis=-1)
    return np.where(np.isfinite(distance), distance, np.inf)


def _edges(patch: np.ndarray) -> Optional[np.ndarray]:
    """(n, 3): lines around a patch seen from above, as normal (outwards) and offset."""
    try:
        return ConvexHull(patch[:, :2]).equations
    except (QhullError, ValueError):
        return None


def _labels(points: np.ndarray) -> np.ndarray:
    """For each point the number of its cluster, from 1."""
    cells = np.floor((points - points.min(axis=0)) / CELL).astype(int)
    grid = np.zeros(cells.max(axis=0) + 1, bool)
    grid[tuple(cells.T)] = True
    return ndimage.label(grid, np.ones((3, 3, 3)))[0][tuple(cells.T)]
