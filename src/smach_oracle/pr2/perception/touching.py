"""Whether a cluster of points is one thing or several that touch: by a waist, or by colours."""

from typing import List, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.box import upright_box
from smach_oracle.geometry.pieces import LEAST_POINTS, largest_piece
from smach_oracle.geometry.plane import Plane

from .clusters import Cluster, OrganizedCloud
from .colours import unlikeness

SLICE = 0.006  # m along the longer side
WAIST = 0.65  # a slice in the middle narrower than this share of both its sides is a waist
# difference of the shares of red, green and blue from which two sides have two colours
CHROMA = 0.06
LEAST_LENGTH = 0.06  # m: shorter things are one
MOST_COLOURS = 4  # of a cluster
LEAST_SHARE = 0.1  # of its points, that are of a third colour
CELL = 0.012  # m: points of one colour that are closer than this belong together


def parts_by_colour(cloud: OrganizedCloud, cluster: Cluster, plane: Plane) -> List[Cluster]:
    """A cluster as the things of different colours that it is made of, or as it is.

    :param plane: of the surface on which it stands.
    """
    if cluster.box.wide < LEAST_LENGTH:
        return [cluster]
    colours = cloud.colour[tuple(cluster.pixels.T)].astype(float)
    ends = _end_shares(_along(cluster)[:, 0], colours)
    if np.abs(ends[0] - ends[1]).max() <= CHROMA:
        return [cluster]
    own = _with_those_between(cluster.points, colours, ends)
    nearest = np.argmin([unlikeness(colours, each) for each in own], axis=0)
    parts = [part_of(cluster, nearest == number, plane) for number in range(len(own))]
    found = [part for part in parts if part is not None]
    return found if len(found) > 1 else [cluster]


def _with_those_between(
    points: np.ndarray, colours: np.ndarray, ends: Sequence[np.ndarray]
) -> List[np.ndarray]:
    """The colours of a cluster's two ends, and of what is unlike both, (3,) each.

    :param points: (n, 3) m.
    :param colours: (n, 3).
    """
    found = list(ends)
    while len(found) < MOST_COLOURS:
        unlike = np.min([unlikeness(colours, each) for each in found], axis=0) > CHROMA
        if unlike.sum() < max(LEAST_POINTS, LEAST_SHARE * len(points)):
            break
        piece = colours[unlike][largest_piece(points[unlike], CELL)]
        between = np.median(piece / np.maximum(piece.sum(axis=1, keepdims=True), 1.0), axis=0)
        if (
            len(piece) < LEAST_POINTS
            or min(float(unlikeness(between, each)) for each in found) <= CHROMA
        ):
            break  # the noise of one colour
        found.append(between)
    return found


def part_of(cluster: Cluster, chosen: np.ndarray, plane: Plane) -> Optional[Cluster]:
    """Return the cluster that some points of a cluster make, or None where they are too few.

    :param chosen: (n,) bool. Those that lie apart from most of them are left out.
    """
    if chosen.sum() < LEAST_POINTS:
        return None
    points, pixels = cluster.points[chosen], cluster.pixels[chosen]
    together = largest_piece(points, CELL)
    if together.sum() < LEAST_POINTS:
        return None
    points, pixels = points[together], pixels[together]
    return Cluster(points, pixels, upright_box(points, plane.z_at(*points[:, :2].mean(axis=0))))


def why_several(cloud: OrganizedCloud, cluster: Cluster) -> str:
    """Return what shows that this is more than one thing, or ''."""
    box = cluster.box
    if box.wide < LEAST_LENGTH:
        return ''
    along = _along(cluster)
    if _has_waist(along):
        return 'it has a waist'
    colours = cloud.colour[tuple(cluster.pixels.T)].astype(float)
    return 'it has two colours, side by side' if _two_colours(along[:, 0], colours) else ''


def _along(cluster: Cluster) -> np.ndarray:
    """(n, 2) m: the footprint, along its length and across."""
    box = cluster.box
    along = (cluster.points[:, :2] - box.centre[:2]) @ box.matrix[:2, :2]
    # round things have no heading, their longer side may be y
    return np.asarray(along[:, ::-1] if box.size[1] > box.size[0] else along)


def _has_waist(flat: np.ndarray) -> bool:
    """Whether a footprint (n, 2) is narrower somewhere in its middle than on both sides of that."""
    slices = np.floor((flat[:, 0] - flat[:, 0].min()) / SLICE).astype(int)
    widths = np.array([_width(flat[slices == index, 1]) for index in range(slices.max() + 1)])
    quarter = len(widths) // 4
    return any(
        widths[at] < WAIST * min(widths[:at].max(), widths[at + 1 :].max())
        for at in range(max(1, quarter), len(widths) - max(1, quarter))
    )


def _width(values: np.ndarray) -> float:
    return float(np.diff(np.percentile(values, [4, 96]))[0]) if len(values) > 3 else 0.0


def _two_colours(along: np.ndarray, colours: np.ndarray) -> bool:
    """Whether the two ends of a footprint differ in colour, whatever light falls on them.

    :param along: (n,) place along the length.
    :param colours: (n, 3).
    """
    ends = _end_shares(along, colours)
    return float(np.abs(ends[0] - ends[1]).max()) > CHROMA


def _end_shares(along: np.ndarray, colours: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """The shares of red, green and blue at the two ends of a footprint, (3,) each."""
    order = np.argsort(along)
    quarter = max(1, len(order) // 4)
    ends = [colours[order[:quarter]].mean(axis=0), colours[order[-quarter:]].mean(axis=0)]
    first, last = (end / max(1.0, end.sum()) for end in ends)
    return first, last
