"""The table and the objects on it in what the head camera sees: a plane, and clusters above it."""
from typing import List, NamedTuple, Sequence

import numpy as np

from smach_oracle.geometry.box import UprightBox, upright_box
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.pieces import largest_patch
from smach_oracle.geometry.plane import Plane, find_plane

from .clusters import (
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
from .touching import why_several

GRASPABLE = 0.085  # m: what fits between the finger tips
LARGEST = 0.35  # m: no object to be handled is wider or taller
TABLE_HEIGHTS = (0.4, 1.2)  # m above the floor
LEAST_TABLE = 1200  # points
TALLEST = 0.8  # m above the table up to which points are looked at
OFF_TABLE = 0.012  # m that a point of the table may seem to lie above or below it


class Tabletop(NamedTuple):
    """What was found, in the frame of the base."""

    table: UprightBox  # the part of the table's top that is in view; its height is 0
    objects: List[UprightBox]  # nearest first; the first one is fit for the gripper


def find_tabletop(image: CameraImage, min_height: float = 0.02,
                  limbs: Sequence[Capsule] = ()) -> Tabletop:
    """The table and what stands on it.

    :param min_height: m above the table; lower clusters are no objects. 0 or less: 0.02.
    :param limbs: where the robot's own arms are, by its encoders; they are taken out of what is
        seen.
    :raises NotSeen: where there is no table, no object, or the nearest one cannot be told well
        enough to be grasped.
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
    clusters = sorted(clusters_on(cloud, plane, patch, lowest, TALLEST), key=_distance)
    if not clusters:
        raise NotSeen('there is nothing on the table that stands higher than {:.0f} cm{}'.format(
            100 * lowest, _hidden_by(cloud)))
    _check_nearest(cloud, clusters[0])
    objects = [each.box for each in clusters if max(each.box.wide, each.box.size[2]) <= LARGEST]
    return Tabletop(_top(patch, plane), objects)


def _top(patch: np.ndarray, plane: Plane) -> UprightBox:
    """The table's top, without thickness."""
    box = upright_box(patch, float(patch[:, 2].min()))
    z = plane.z_at(box.centre[0], box.centre[1])
    return box._replace(centre=np.array([box.centre[0], box.centre[1], z]),
                        size=box.size * [1, 1, 0])


def _distance(cluster: Cluster) -> float:
    return float(np.hypot(*cluster.box.centre[:2]))


def _check_nearest(cloud: OrganizedCloud, cluster: Cluster) -> None:
    """Raise NotSeen where the nearest cluster is not one object that the gripper can take."""
    box = cluster.box
    limb = limb_beside(cloud, cluster)
    if limb is not None:
        raise NotSeen('the {} hides part of the nearest object'.format(limb))
    if cut_off(cloud, cluster):
        raise NotSeen('the nearest object is cut off by the edge of the image')
    extent = '{:.0f} x {:.0f} x {:.0f} cm'.format(*(100 * box.size))
    if max(box.wide, box.size[2]) > LARGEST:
        raise NotSeen(
            'what is nearest is no object: it is too large, {}; is an arm in the view?'.format(
                extent))
    if box.narrow > GRASPABLE:
        raise NotSeen(
            'what is nearest is too large for the gripper, {}: one thing, or several that touch'.
            format(extent))
    several = why_several(cloud, cluster)
    if several:
        raise NotSeen('what is nearest, {}, seems to be several things that touch: {}'.format(
            extent, several))


def _no_table(cloud: OrganizedCloud) -> str:
    if cloud.known < 0.3:
        return 'no table in view: depth is missing for {:.0f}% of the image'.format(
            100 * (1 - cloud.known))
    return 'no table in view{}'.format(_hidden_by(cloud))


def _hidden_by(cloud: OrganizedCloud) -> str:
    """Which limb covers much of the image, as the end of a sentence."""
    shares = [(float((cloud.hidden == index).mean()), name)
              for index, name in enumerate(cloud.limbs)]
    share, name = max(shares, default=(0.0, ''))
    return '; the {} covers {:.0f}% of the view'.format(name, 100 * share) if share > 0.03 else ''
