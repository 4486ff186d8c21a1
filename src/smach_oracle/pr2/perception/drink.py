"""A drink in the open refrigerator as the head camera sees it: the shelf, and what is on it."""

from typing import List, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import pixels_of
from smach_oracle.geometry.pieces import largest_patch
from smach_oracle.geometry.plane import Plane, find_plane
from smach_oracle.geometry.transforms import apply, inverse

from ..kitchen import Kitchen, shelf_region
from .blind import blind_beside, blind_distance, blind_patches
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
from .colours import GREY, NAMES, name_of, names_of
from .touching import part_of, why_several

SLACK = 0.12  # m that the map may be wrong, horizontally
SHELF_SLACK = 0.04  # m, vertically
LEAST_SHELF = 250  # points
OFF_SHELF = 0.012  # m
MARGIN = 0.018  # m from the shelf's edge: there are walls
NARROW = (0.035, 0.085)  # m: a drink's smaller horizontal extent, as far as the gripper takes it
WIDEST = 0.11  # m
SHEET = 0.015  # m: what is thinner is a piece of a wall
HEIGHTS = (0.05, 0.32)  # m
WHOLE = 0.8  # share of a thing's points that have its colour, at least
# how a reason ends where a patch of the image has no depth, before the shelf
BLIND = ': depth is missing in a patch of the image, before the shelf'
HIDDEN = 0.5  # share of the shelf from which its being hidden is the reason


def find_drink(
    image: CameraImage,
    kitchen: Kitchen,
    base_from_fridge: np.ndarray,
    min_height: float = 0.03,
    limbs: Sequence[Capsule] = (),
    colour: str = '',
) -> UprightBox:
    """The foremost thing on the drinks' shelf that can be a drink, in the frame of the base.

    :param base_from_fridge: 4x4, where the map has the fridge, right to some 0.1 m.
    :param min_height: m above the shelf. Lower clusters are no drinks. 0 or less: 0.03.
    :param limbs: where the robot's own arms are. They are taken out of what is seen.
    :param colour: one of colours.NAMES: a drink of this colour, and no other. '' means any.
    :raises NotSeen: where the shelf is not in view or hidden, nothing on it can be such a drink, or
        there is no such colour.
    """
    if colour and colour not in NAMES:
        raise NotSeen('colour is {!r}; allowed: {}'.format(colour, ', '.join(NAMES)))
    cloud = cloud_of(image, limbs)
    points = _about_shelf(cloud, kitchen, base_from_fridge)
    plane = find_plane(points, generator_of(image), tolerance=OFF_SHELF, least=LEAST_SHELF)
    patch = (
        largest_patch(points[np.abs(plane.height(points)) < OFF_SHELF])
        if plane is not None
        else points[:0]
    )
    if plane is None or len(patch) < LEAST_SHELF:
        raise NotSeen(_no_shelf(image, kitchen, base_from_fridge, cloud))
    seen = _in_front(cloud, plane, patch, kitchen, base_from_fridge, min_height)
    clusters = _of_colour(cloud, seen, plane, colour) if colour else seen
    blind = blind_patches(image)
    reasons = [
        _why_no_drink(
            cloud, each, 'the {} thing'.format(colour) if colour else 'what is foremost', blind
        )
        for each in clusters
    ]
    drinks = [each.box for each, reason in zip(clusters, reasons) if not reason]
    if drinks:
        return drinks[0]
    hidden = _share_hidden(image, kitchen, base_from_fridge)[1]
    if hidden > HIDDEN:
        raise NotSeen('no drink in view: the door hides {:.0f}% of the shelf'.format(100 * hidden))
    raise NotSeen(
        'no {}drink: {}'.format(
            colour and colour + ' ',
            reasons[0]
            if reasons
            else _on_shelf(cloud, seen)
            + ('' if blind_distance(image, blind, plane, patch) is None else BLIND),
        )
    )


def _of_colour(
    cloud: OrganizedCloud, clusters: Sequence[Cluster], plane: Plane, colour: str
) -> List[Cluster]:
    """Return the things of a colour: whole, or parts of things that touch, foremost first."""
    found = []
    for cluster in clusters:
        pixels = cloud.colour[tuple(cluster.pixels.T)]
        part = part_of(cluster, names_of(pixels) == colour, plane)
        if part is not None and (colour != GREY or name_of(pixels.mean(axis=0)) == GREY):
            whole = len(part.points) > WHOLE * len(cluster.points)
            found.append(cluster if whole else part)
    return found


def _on_shelf(cloud: OrganizedCloud, clusters: Sequence[Cluster]) -> str:
    """Say what is on the shelf, for people."""
    names = [
        name_of(cloud.colour[tuple(each.pixels.T)].mean(axis=0)) or 'dark' for each in clusters
    ]
    if not names:
        return 'there is nothing on the shelf'
    return 'there are {} things on the shelf: {}'.format(len(names), ', '.join(names))


def things_on_shelf(
    image: CameraImage,
    kitchen: Kitchen,
    base_from_fridge: np.ndarray,
    limbs: Sequence[Capsule] = (),
) -> List[UprightBox]:
    """Everything seen on the drinks' shelf, foremost first, or [] where the shelf is not seen.

    Parameters and boxes are as in find_drink().
    """
    cloud = cloud_of(image, limbs)
    points = _about_shelf(cloud, kitchen, base_from_fridge)
    plane = find_plane(points, generator_of(image), tolerance=OFF_SHELF, least=LEAST_SHELF)
    if plane is None:
        return []
    patch = largest_patch(points[np.abs(plane.height(points)) < OFF_SHELF])
    return [each.box for each in _in_front(cloud, plane, patch, kitchen, base_from_fridge, 0.0)]


def _about_shelf(
    cloud: OrganizedCloud, kitchen: Kitchen, base_from_fridge: np.ndarray
) -> np.ndarray:
    """(n, 3): the points that may be of the shelf, in the frame of the base."""
    points = cloud.points[np.isfinite(cloud.points[..., 2])]
    local = apply(inverse(base_from_fridge), points)
    low, high = shelf_region(kitchen)
    slack = np.array([SLACK, SLACK])
    near = ((local[:, :2] > low[:2] - slack) & (local[:, :2] < high[:2] + slack)).all(axis=1)
    return points[near & (np.abs(local[:, 2] - low[2]) < SHELF_SLACK)]


def _in_front(
    cloud: OrganizedCloud,
    plane: Plane,
    patch: np.ndarray,
    kitchen: Kitchen,
    base_from_fridge: np.ndarray,
    min_height: float,
) -> List[Cluster]:
    """Return the things that stand on the shelf, foremost first."""
    low, high = shelf_region(kitchen)
    lowest = max(OFF_SHELF, min_height if min_height > 0 else 0.03)
    found = clusters_on(cloud, plane, patch, lowest, float(high[2] - low[2]) - 0.02, MARGIN)
    inwards = base_from_fridge[:3, 0]
    things = (each for each in found if each.box.narrow > SHEET)
    return sorted(things, key=lambda cluster: float(cluster.box.centre @ inwards))


def _why_no_drink(cloud: OrganizedCloud, cluster: Cluster, what: str, blind: np.ndarray) -> str:
    """Return why a cluster cannot be taken for a drink, or ''.

    :param what: what it is, for people.
    :param blind: the patches of the image that have no depth.
    """
    box = cluster.box
    extent = '{:.0f} x {:.0f} x {:.0f} cm'.format(*(100 * box.size))
    limb = limb_beside(cloud, cluster)
    if limb is not None:
        return 'the {} hides part of {} on the shelf'.format(limb, what)
    if cut_off(cloud, cluster):
        return '{} on the shelf is cut off by the edge of the image'.format(what)
    if blind_beside(blind, cluster):
        return '{} on the shelf may be hidden in part'.format(what) + BLIND
    if not HEIGHTS[0] <= box.size[2] <= HEIGHTS[1] or box.narrow < NARROW[0]:
        return '{} on the shelf, {}, has not the size of a drink'.format(what, extent)
    if box.narrow > NARROW[1] or box.wide > WIDEST:
        return '{} on the shelf is too large, {}: one thing, or several that touch'.format(
            what, extent
        )
    several = why_several(cloud, cluster)
    return (
        '{} on the shelf, {}, seems to be several things that touch: {}'.format(
            what, extent, several
        )
        if several
        else ''
    )


def _no_shelf(
    image: CameraImage, kitchen: Kitchen, base_from_fridge: np.ndarray, cloud: OrganizedCloud
) -> str:
    in_image, hidden = _share_hidden(image, kitchen, base_from_fridge)
    if in_image < 0.3:
        return 'no shelf in view: the camera does not look into the refrigerator'
    if hidden > HIDDEN:
        return 'the door hides the shelf: {:.0f}% of it is behind something nearer'.format(
            100 * hidden
        )
    if cloud.known < 0.3:
        return 'no shelf in view: depth is missing for {:.0f}% of the image'.format(
            100 * (1 - cloud.known)
        )
    return 'no shelf in view where the map has it'


def _share_hidden(
    image: CameraImage, kitchen: Kitchen, base_from_fridge: np.ndarray
) -> Tuple[float, float]:
    """Share of the shelf's front half that is in the image, and share of that which is hidden."""
    low, high = shelf_region(kitchen)
    across, inwards = np.meshgrid(
        np.linspace(low[1], high[1], 24)[2:-2], np.linspace(low[0], high[0] / 2, 10)[1:]
    )
    # a drink on the shelf hides some of that as well: so look a drink's height above the shelf
    grid = np.column_stack([inwards.ravel(), across.ravel(), np.full(inwards.size, low[2] + 0.15)])
    seen = pixels_of(apply(base_from_fridge, grid), image.intrinsics, image.base_from_camera)
    columns, rows = np.round(seen[:, :2]).T
    height, width = image.depth.shape
    inside = (seen[:, 2] > 0) & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    if not inside.any():
        return 0.0, 0.0
    depth = image.depth[rows[inside].astype(int), columns[inside].astype(int)]
    with np.errstate(invalid='ignore'):
        hidden = depth < seen[inside, 2] - SLACK / 2
    return float(inside.mean()), float(hidden.mean())
