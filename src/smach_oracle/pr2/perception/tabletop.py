"""The table and the objects on it in what the head camera sees: a plane, and clusters above it."""

from typing import List, NamedTuple, Optional, Sequence, Tuple, cast

import numpy as np

from smach_oracle.geometry.box import UprightBox, upright_box
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.pieces import largest_patch
from smach_oracle.geometry.plane import Plane, find_plane

from .blind import blind_beside, blind_distance, blind_patches
from .clusters import (
    HERE,
    Capsule,
    Cluster,
    NotSeen,
    OrganizedCloud,
    cloud_of,
    clusters_on,
    cut_off,
    generator_of,
    limb_beside,
)
from .colours import SAME, SAME_POINT, name_of, unlikeness
from .touching import part_of, parts_by_colour, why_several
from .upright import UPRIGHT

GRASPABLE = 0.085  # m: what fits between the finger tips
LARGEST = 0.35  # m: no object to be handled is wider or taller
TABLE_HEIGHTS = (0.4, 1.2)  # m above the floor
LEAST_TABLE = 1200  # points
TALLEST = 0.8  # m above the table up to which points are looked at
OFF_TABLE = 0.012  # m that a point of the table may seem to lie above or below it
EDGE, LEAST_EDGE = 2, 6  # columns of an image at its edge, and points of a table in them
AHEAD, BESIDE = 0.08, 0.12  # m from the nearest of these to what shows what is beyond
# how a reason ends where a patch of the image has no depth, before the table
BLIND = ': depth is missing in a patch of the image, before the table'
SAME_SIZE = 0.025  # m by which one thing's extents may differ in two images


class Look(NamedTuple):
    """The looks of a thing in an earlier image."""

    colour: np.ndarray  # (3,) red, green and blue, 0 to 255
    size: np.ndarray  # (3,) m


class Tabletop(NamedTuple):
    """The table and the objects that were found, in the frame of the base."""

    table: UprightBox  # the part of the table's top that is in view. Its height is 0
    # the one that was asked for, then nearest first. The first one is fit for the gripper
    objects: List[UprightBox]
    colours: List[np.ndarray]  # (3,) each, of the objects, 0 to 255
    # (3,) each, m: where to look for more of the table, which the image cuts off nearer than the
    # first object stands
    beyond: Sequence[np.ndarray] = ()


def find_tabletop(
    image: CameraImage,
    min_height: float = 0.02,
    limbs: Sequence[Capsule] = (),
    like: Optional[Look] = None,
    near: np.ndarray = HERE,
) -> Tabletop:
    """The table and what stands on it.

    :param min_height: m above the table. Lower clusters are no objects. 0 or less: 0.02.
    :param limbs: where the robot's own arms are, by its encoders. They are taken out of what is
        seen.
    :param like: what the object that is looked for looked like. None means it is the nearest one.
    :param near: (2,) m or more, from which "nearest" counts.
    :raises NotSeen: where there is no table, no object, or the one that is looked for cannot be
        told well enough to be grasped.
    """
    cloud = cloud_of(image, limbs)
    points = cloud.points[np.isfinite(cloud.points[..., 2])]
    at_table = points[(points[:, 2] > TABLE_HEIGHTS[0]) & (points[:, 2] < TABLE_HEIGHTS[1])]
    plane = find_plane(at_table, generator_of(image), tolerance=OFF_TABLE, least=LEAST_TABLE)
    if plane is None:
        raise NotSeen(_no_table(cloud))
    patch = largest_patch(at_table[np.abs(plane.height(at_table)) < OFF_TABLE])
    if len(patch) < LEAST_TABLE:
        raise NotSeen(_no_table(cloud))
    lowest = max(OFF_TABLE, min_height if min_height > 0 else 0.02)
    clusters = sorted(
        (
            part
            for each in clusters_on(cloud, plane, patch, lowest, TALLEST)
            for part in parts_by_colour(cloud, each, plane)
        ),
        key=lambda each: distance_from(near, each.box.centre),
    )
    blind = blind_patches(image)
    hidden = blind_distance(image, blind, plane, patch, near)
    if not clusters:
        raise NotSeen(
            'there is nothing on the table that stands higher than {:.0f} cm{}{}'.format(
                100 * lowest, _hidden_by(cloud), '' if hidden is None else BLIND
            )
        )
    if like is None:
        target, what = clusters[0], 'the nearest object'
    else:
        target, what = _like(cloud, clusters, plane, like, hidden is not None), 'the object'
    _check(cloud, target, what)
    away = distance_from(near, target.box.centre)
    if blind_beside(blind, target) or (
        like is None and hidden is not None and hidden < away + target.box.wide
    ):
        raise NotSeen('{} may be hidden in part, or something nearer{}'.format(what, BLIND))
    order = [target] + [each for each in clusters if not _overlap(each, target)]
    objects = [each for each in order if max(each.box.wide, float(each.box.size[2])) <= LARGEST]
    return Tabletop(
        _top(patch, plane),
        [each.box for each in objects],
        [_colour(cloud, each) for each in objects],
        _beyond(cloud, plane, away, near),
    )


def things_on_table(image: CameraImage, limbs: Sequence[Capsule] = ()) -> List[UprightBox]:
    """All that stands on the table, whatever it is, in no order, or [] where no table is seen.

    Parameters and boxes are as in find_tabletop().
    """
    cloud = cloud_of(image, limbs)
    points = cloud.points[np.isfinite(cloud.points[..., 2])]
    at_table = points[(points[:, 2] > TABLE_HEIGHTS[0]) & (points[:, 2] < TABLE_HEIGHTS[1])]
    plane = find_plane(at_table, generator_of(image), tolerance=OFF_TABLE, least=LEAST_TABLE)
    if plane is None:
        return []
    patch = largest_patch(at_table[np.abs(plane.height(at_table)) < OFF_TABLE])
    return [
        each.box
        for each in clusters_on(cloud, plane, patch, 0.02, TALLEST)
        if max(each.box.wide, float(each.box.size[2])) <= LARGEST
    ]


def _beyond(
    cloud: OrganizedCloud, plane: Plane, distance: float, near: np.ndarray
) -> List[np.ndarray]:
    """Return where to look, (3,) each, for things nearer than `distance` m next to the image."""
    found = []
    for edge in (cloud.points[:, :EDGE], cloud.points[:, -EDGE:]):
        points = edge[np.isfinite(edge[..., 2])]
        points = points[np.abs(plane.height(points)) < OFF_TABLE]
        away = np.hypot(*(points[:, :2] - near[:2]).T)
        if len(points) >= LEAST_EDGE and away.min() < distance:
            nearest = points[away.argmin()]
            aside = float(np.copysign(BESIDE, nearest[1]))
            found.append(nearest + [AHEAD, aside, 0.0])
    return found


def _top(patch: np.ndarray, plane: Plane) -> UprightBox:
    """The table's top, without thickness."""
    box = upright_box(patch, float(patch[:, 2].min()))
    # elements, which numpy's types may take for arrays
    x, y = cast('Tuple[float, float]', box.centre[:2])
    z = plane.z_at(x, y)
    return box._replace(centre=np.array([x, y, z]), size=box.size * [1, 1, 0])


def distance_from(near: np.ndarray, point: np.ndarray) -> float:
    """Return how far apart two points, (2,) m or more, are in the plane, m."""
    return float(np.hypot(*(point[:2] - near[:2])))


def _colour(cloud: OrganizedCloud, cluster: Cluster) -> np.ndarray:
    return np.asarray(cloud.colour[tuple(cluster.pixels.T)].mean(axis=0))


def _overlap(one: Cluster, other: Cluster) -> bool:
    """Whether two clusters have their middles within each other: one is part of the other."""
    away = float(np.hypot(*(one.box.centre - other.box.centre)[:2]))
    return one is other or away < min(one.box.narrow, other.box.narrow) / 2


def _like(
    cloud: OrganizedCloud, clusters: Sequence[Cluster], plane: Plane, like: Look, blind: bool
) -> Cluster:
    """The cluster, or part of one, that looks as the object did.

    :param blind: whether part of the table cannot be seen.
    :raises NotSeen: where none does.
    """
    alike: List[Tuple[float, int, Cluster]] = []
    lying: Optional[Cluster] = None
    for cluster in clusters:
        near = unlikeness(cloud.colour[tuple(cluster.pixels.T)], like.colour) < SAME_POINT
        for part in (cluster, part_of(cluster, near, plane)):
            if part is None:
                continue
            off = _extents(part.box.size) - _extents(like.size)
            differs = float(unlikeness(_colour(cloud, part), like.colour))
            if differs < SAME and np.abs(off).max() < SAME_SIZE:
                alike.append((differs / SAME + np.abs(off).max() / SAME_SIZE, len(alike), part))
            elif differs < SAME and _lies(part.box.size, like.size):
                lying = part
    if not alike and lying is not None:
        raise NotSeen(
            'what was seen first, {} and {}, lies on the table at x {:.2f}, y {:.2f} m: the hand '
            'takes only what stands'.format(
                name_of(like.colour) or 'dark', _in_cm(like.size), *lying.box.centre[:2]
            )
        )
    if not alike:
        raise NotSeen(
            'what was seen first, {} and {}, is not among the {} things on the table: '
            '{}{}{}'.format(
                name_of(like.colour) or 'dark',
                _in_cm(like.size),
                len(clusters),
                ', '.join(name_of(_colour(cloud, each)) or 'dark' for each in clusters),
                _hidden_by(cloud),
                BLIND if blind else '',
            )
        )
    return min(alike)[2]


def _in_cm(size: np.ndarray) -> str:
    return '{:.0f} x {:.0f} x {:.0f} cm'.format(*(100 * size))


def _extents(size: np.ndarray) -> np.ndarray:
    return np.array([max(size[:2]), min(size[:2]), size[2]])


def _lies(size: np.ndarray, stood: np.ndarray) -> bool:
    """Whether a thing is about as long as another was high, and less high than that."""
    return bool(size[2] < UPRIGHT * stood[2] and abs(max(size[:2]) - stood[2]) < SAME_SIZE)


def _check(cloud: OrganizedCloud, cluster: Cluster, what: str) -> None:
    """Raise NotSeen where a cluster is not one object that the gripper can take.

    :param what: the object that it should be, for people.
    """
    box = cluster.box
    limb = limb_beside(cloud, cluster)
    if limb is not None:
        raise NotSeen('the {} hides part of {}'.format(limb, what))
    if cut_off(cloud, cluster):
        raise NotSeen('{} is cut off by the edge of the image'.format(what), box.centre)
    extent = _in_cm(box.size)
    if max(box.wide, float(box.size[2])) > LARGEST:
        raise NotSeen(
            'what is nearest is no object: it is too large, {}; is an arm in the view?'.format(
                extent
            )
        )
    if box.narrow > GRASPABLE:
        raise NotSeen(
            'what is nearest is too large for the gripper, {}: one thing, or several that '
            'touch'.format(extent)
        )
    several = why_several(cloud, cluster)
    if several:
        raise NotSeen(
            'what is nearest, {}, seems to be several things that touch: {}'.format(extent, several)
        )


def _no_table(cloud: OrganizedCloud) -> str:
    if cloud.known < 0.3:
        return 'no table in view: depth is missing for {:.0f}% of the image'.format(
            100 * (1 - cloud.known)
        )
    return 'no table in view{}'.format(_hidden_by(cloud))


def _hidden_by(cloud: OrganizedCloud) -> str:
    """Return which limb covers much of the image, as the end of a sentence."""
    shares = [
        (float((cloud.hidden == index).mean()), name) for index, name in enumerate(cloud.limbs)
    ]
    share, name = max(shares, default=(0.0, ''))
    return '; the {} covers {:.0f}% of the view'.format(name, 100 * share) if share > 0.03 else ''
