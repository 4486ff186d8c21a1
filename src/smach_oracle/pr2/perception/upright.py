"""Whether what an image shows at a place stands there, and is the thing that was meant."""

from typing import NamedTuple, Optional, Sequence, Tuple, cast

import numpy as np

from smach_oracle.geometry.box import UprightBox, upright_box
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.pieces import piece_labels
from smach_oracle.geometry.plane import find_plane

from ..kitchen import MapBox
from .clusters import cloud_of, generator_of
from .colours import SAME, name_of, unlikeness

NEAR = 0.05  # m around the place, within which an image must show the object
AROUND = 0.04  # m beyond a standing object, in which the upper end of a leaning one may be
CLEAR = 0.02  # m above its support, from where points are the object's
LEAST_POINTS = 40
CELL = 0.012  # m: points that are closer than this belong together
BLUR = 0.005  # m by which an edge is seen beside where it is
# of its height at least: less, and it lies. What is taken is at least 1.4 times as high as wide
UPRIGHT = 0.82
# rad from which a thing does not count as standing. The measure errs by one or two degrees
LEANS = np.radians(15.0)
STEEPEST = np.radians(60.0)  # of a plane that is looked for. What is steeper is a side
# rad of a top. A plane between this and the steepest one runs through a top and a side: of a slim
# thing that leans by 20 degrees, such a one may have more points than the top
TOP = np.radians(50.0)
FLAT = 0.004  # m that the points of a top may lie off its plane
LEAST_TOP = 25  # points of a top
# m by which what leans by 15 degrees is wider than what stands. Noise, and a map that is off, make
# less of it
WIDER = 0.015
TALLER = 0.03  # m by which another thing stands out above the object


class StandingLook(NamedTuple):
    """The looks of a thing while it stood."""

    # (3,) red, green and blue, 0 to 255. None: not seen, or too dark to tell
    colour: Optional[np.ndarray] = None
    # whether its top is flat and level, so that an image shows whether the thing leans
    level: bool = True


UNKNOWN = StandingLook()


def look_of(image: CameraImage, box: UprightBox) -> StandingLook:
    """Return the looks of a thing that stands in a box (in base_footprint)."""
    half = box.size / 2
    points, colours = _seen_at(image, box.centre, half, ())
    inside = MapBox(box.centre, half, box.yaw).beyond(points) < BLUR
    points, colours = points[inside.all(axis=1)], colours[inside.all(axis=1)]
    if len(points) < LEAST_POINTS:
        return UNKNOWN
    lean = _lean_of(image, points, box.centre, half)
    return StandingLook(_colour_of(colours), lean is not None and lean < LEANS / 2)


def why_not_standing(
    image: CameraImage,
    centre: np.ndarray,
    half: np.ndarray,
    others: Sequence[MapBox] = (),
    look: StandingLook = UNKNOWN,
) -> str:
    """Return why an object does not stand at its place, as an image shows it, or ''.

    :param centre: (3,) m in base_footprint, where the object's centre should be.
    :param half: (3,) m, its half extents.
    :param others: what stands beside the place. It does not count.
    :param look: the looks of the object before.
    """
    points, colours = _seen_at(image, centre, half, others)
    if len(points) < LEAST_POINTS:
        return 'nothing stands at its place'
    colour = _colour_of(colours)
    if (
        look.colour is not None
        and colour is not None
        and float(unlikeness(colour, look.colour)) > SAME
    ):
        return 'another thing is at its place: that is {}, and the object is {}'.format(
            name_of(colour), name_of(look.colour)
        )
    # an element, which numpy's types may take for an array
    tall = 2 * cast('float', half[2])
    high = float(np.percentile(points[:, 2], 90)) - (centre[2] - half[2])
    in_cm = '{:.0f} cm high, and the object is {:.0f} cm'.format(100 * high, 100 * tall)
    if high < UPRIGHT * tall:
        return 'it lies at its place: what is there is ' + in_cm
    lean = _lean_of(image, points, centre, half) if look.level else 0.0
    if lean is None:
        return 'it leans at its place: no level top is seen'
    if lean > LEANS:
        return 'it leans by {:.0f} degrees at its place'.format(np.degrees(lean))
    near = points[np.hypot(*(points[:, :2] - centre[:2]).T) < NEAR]
    if upright_box(near, float(near[:, 2].min())).wide > 2 * max(half[:2]) + WIDER:
        return 'it leans at its place, or something touches it: together they are wider'
    return '' if high < tall + TALLER else 'another thing is at its place: that is ' + in_cm


def _seen_at(
    image: CameraImage, centre: np.ndarray, half: np.ndarray, others: Sequence[MapBox]
) -> Tuple[np.ndarray, np.ndarray]:
    """The points (n, 3) of the piece that takes up most of a place, and their colours (n, 3)."""
    cloud = cloud_of(image)
    bottom = centre[2] - half[2]
    beside = np.hypot(cloud.points[..., 0] - centre[0], cloud.points[..., 1] - centre[1])
    there = (
        (beside < np.hypot(*half[:2]) + AROUND)
        & (cloud.points[..., 2] > bottom + CLEAR)
        & (cloud.points[..., 2] < bottom + 3 * half[2])
    )
    points, colours, beside = cloud.points[there], cloud.colour[there], beside[there]
    for box in others:
        outside = (box.beyond(points) >= BLUR).any(axis=1)
        points, colours, beside = points[outside], colours[outside], beside[outside]
    if not (beside < NEAR).any():
        return points[:0], colours[:0]
    labels = piece_labels(points, CELL)
    own = labels == np.bincount(labels[beside < NEAR]).argmax()
    return points[own], colours[own]


def _lean_of(
    image: CameraImage, points: np.ndarray, centre: np.ndarray, half: np.ndarray
) -> Optional[float]:
    """Return the inclination of the top of a thing (n, 3), rad, or None where it has none."""
    upper = points[points[:, 2] > centre[2]]
    top = find_plane(upper, generator_of(image), FLAT, STEEPEST, LEAST_TOP)
    lean = np.pi if top is None else float(np.arccos(min(1.0, top.normal[2])))
    return lean if lean < TOP else None


def _colour_of(colours: np.ndarray) -> Optional[np.ndarray]:
    """The mean (3,) of colours (n, 3), or None where it is too dark to tell."""
    mean = np.asarray(colours.mean(axis=0))
    return mean if name_of(mean) else None
