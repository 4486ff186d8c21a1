"""What stands on a level surface in a camera frame: the surface, and the clusters of points above it."""
import zlib
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import ndimage

from ...geometry.box import UprightBox, upright_box
from ...geometry.depth import points_of
from ...geometry.pieces import standing_on
from ...geometry.plane import Plane
from .interface import Frame

STRIDE = 2  # every second row and column: a quarter of the work, and objects still have hundreds of points
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


def clusters_on(view: View, plane: Plane, patch: np.ndarray, lowest: float, highest: float,
                margin: float = MARGIN) -> List[Cluster]:
    """The clusters above a surface, in no order; a small one is taken for noise.

    :param patch: (n, 3) points of the surface; clusters stand within its convex hull.
    :param lowest: m above the surface from which points count, up to `highest`.
    """
    seen = np.isfinite(view.points[..., 2])
    points, pixels = view.points[seen], np.argwhere(seen)
    found = []
    for chosen in standing_on(points, plane, patch, lowest, highest, margin):
        own = points[chosen]
        found.append(Cluster(own, pixels[chosen], upright_box(own, plane.z_at(*own[:, :2].mean(axis=0)))))
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
