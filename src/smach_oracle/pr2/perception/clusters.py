"""Things on a level surface in a camera image: clusters of points above the surface."""

import zlib
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import ndimage

from smach_oracle.geometry.box import UprightBox, upright_box
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of
from smach_oracle.geometry.pieces import standing_on
from smach_oracle.geometry.plane import Plane

# that are looked at: enough for objects to have hundreds of points
COLUMNS = 320
HERE = np.zeros(2)  # m, the robot's own middle
MARGIN = 0.01  # m that things must stand inside the edge of the surface


class NotSeen(Exception):
    """The image does not show what was looked for. The text is the reason, for people.

    :param where: (3,) m in the frame of the base, at which to look to see more. None means not
        known.
    """

    def __init__(self, reason: str, where: Optional[np.ndarray] = None) -> None:
        super().__init__(reason)
        self.where = where


class Capsule(NamedTuple):
    """A part of the robot's own body: everything within `radius` of a line."""

    name: str  # of the limb, for people
    start: np.ndarray  # (3,) m, in the frame of the base
    end: np.ndarray  # (3,)
    radius: float  # m


class OrganizedCloud(NamedTuple):
    """An image as points in the frame of the base, thinned out."""

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


def cloud_of(
    image: CameraImage, limbs: Sequence[Capsule] = (), reach: float = 2.5
) -> OrganizedCloud:
    """The points of an image within `reach` m of depth, without those of the robot's own limbs."""
    stride = image.stride(COLUMNS)
    depth = image.depth[::stride, ::stride]
    measured = np.isfinite(depth) & (depth > 0)
    near = np.where(measured & (depth < reach), depth, np.nan)
    points = points_of(near, image.intrinsics, image.base_from_camera, stride=stride)
    hidden = np.full(depth.shape, -1)
    for index, limb in enumerate(limbs):
        hidden[_distance(points, limb) < limb.radius] = index
    points[hidden >= 0] = np.nan
    return OrganizedCloud(
        points,
        image.colour[::stride, ::stride],
        hidden,
        tuple(limb.name for limb in limbs),
        float(measured.mean()),
    )


def generator_of(image: CameraImage) -> np.random.Generator:
    """Random numbers that depend on the image alone, so that it always gives the same result."""
    return np.random.default_rng(zlib.crc32(np.ascontiguousarray(image.depth).tobytes()))


def clusters_on(
    cloud: OrganizedCloud,
    plane: Plane,
    patch: np.ndarray,
    lowest: float,
    highest: float,
    margin: float = MARGIN,
) -> List[Cluster]:
    """The clusters above a surface, in no order. A small one is taken for noise.

    :param patch: (n, 3) points of the surface. Clusters stand within its convex hull.
    :param lowest: m above the surface from which points count, up to `highest`.
    """
    seen = np.isfinite(cloud.points[..., 2])
    points, pixels = cloud.points[seen], np.argwhere(seen)
    found = []
    for chosen in standing_on(points, plane, patch, lowest, highest, margin):
        own = points[chosen]
        found.append(
            Cluster(own, pixels[chosen], upright_box(own, plane.z_at(*own[:, :2].mean(axis=0))))
        )
    return found


def limb_beside(cloud: OrganizedCloud, cluster: Cluster) -> Optional[str]:
    """The limb that is seen right beside a cluster and so hides part of it, or None."""
    own = np.zeros(cloud.hidden.shape, bool)
    own[tuple(cluster.pixels.T)] = True
    around = ndimage.binary_dilation(own, iterations=4)
    limbs = cloud.hidden[around & (cloud.hidden >= 0)]
    return cloud.limbs[np.bincount(limbs).argmax()] if len(limbs) >= 8 else None


def cut_off(cloud: OrganizedCloud, cluster: Cluster) -> bool:
    """Whether the edge of the image cuts a cluster off."""
    height, width = cloud.hidden.shape
    rows, columns = cluster.pixels.T
    return bool(
        rows.min() < 2 or columns.min() < 2 or rows.max() > height - 3 or columns.max() > width - 3
    )


def _distance(points: np.ndarray, limb: Capsule) -> np.ndarray:
    axis = limb.end - limb.start
    length = float(axis @ axis)
    along = (
        np.clip((points - limb.start) @ axis / length, 0.0, 1.0)
        if length > 1e-9
        else np.zeros(points.shape[:-1])
    )
    distance = np.linalg.norm(points - limb.start - along[..., None] * axis, axis=-1)
    return np.where(np.isfinite(distance), distance, np.inf)
