"""From a drawing on a camera image to the object: GrabCut gives a mask, depth place and size.

Works on any image that has colour, depth, intrinsics and the camera's pose. It knows no ROS. The
same image and drawing give the same object. The segmentation interface of the paper, section V-A.
"""

from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of
from smach_oracle.geometry.marked_object import object_above
from smach_oracle.geometry.plane import Plane, find_plane

LEAST_SIDE = 4  # px of a region
LEAST_MASK = 40  # px
LEAST_SHARE = 0.03  # of the region's area that a mask must have
LEAST_DEPTH = 30  # pixels of the mask with a depth
LEAST_DEPTH_SHARE = 0.15
# px that GrabCut sees. A larger crop is scaled down, so that the answer stays quick
WORK_AREA = 26000
ITERATIONS = 4
STROKE_WIDTH = 5.0  # px
ON_SURFACE = 0.008  # m: a point no further from the surface belongs to that, not to the object

_NO_RECTANGLE = (0, 0, 0, 0)  # of GrabCut, which begins from a mask

Corners = Tuple[int, int, int, int]  # left, top, right, bottom. The last two excluded


class SegmentationError(Exception):
    """The drawing gives no object. The text says why and what may help.

    `mask`: (h, w) bool, where GrabCut found one and a later step failed.
    """

    def __init__(self, text: str, mask: Optional[np.ndarray] = None) -> None:
        super().__init__(text)
        self.mask = mask


class Stroke(NamedTuple):
    """A line drawn on the image."""

    foreground: bool  # it lies on the object
    points: np.ndarray  # (n, 2) px: right, down
    width: float = STROKE_WIDTH  # px


class SegmentedObject(NamedTuple):
    """An object cut out of an image."""

    mask: np.ndarray  # (h, w) bool
    box: UprightBox  # in the frame of the base
    points: np.ndarray  # (n, 3) m, in the frame of the base
    colours: np.ndarray  # (n, 3) uint8
    surface: Optional[Plane]  # what it stands on, or None where the image does not show it


def rectangle(left: float, top: float, width: float, height: float) -> np.ndarray:
    """(4, 2) px: a rectangle as a region."""
    return np.array(
        [[left, top], [left + width, top], [left + width, top + height], [left, top + height]],
        float,
    )


def segment(
    image: CameraImage, region: np.ndarray, strokes: Sequence[Stroke] = ()
) -> SegmentedObject:
    """Cut out the object.

    :param region: (n, 2) px, corners of a polygon that holds the whole object, n >= 3.
    :raises SegmentationError: for a region that cannot be used, a mask that collapses, or too
        little depth under it.
    """
    inside = _filled(image, region)
    crop, surroundings = _around(inside, 0.35, 12), _around(inside, 0.8, 40)
    surface = _surface(image, inside, surroundings)
    mask = _grab_cut(image, inside, crop, strokes, surface)
    return _with_depth(image, mask, surface)


def _filled(image: CameraImage, region: np.ndarray) -> np.ndarray:
    """(h, w) bool: the region's part of the image."""
    region = np.asarray(region, float)
    height, width = image.depth.shape
    if region.ndim != 2 or region.shape[1] != 2 or len(region) < 3:
        raise SegmentationError('the region needs 3 corners or more, each with x and y')
    if not np.isfinite(region).all():
        raise SegmentationError('the region has corners that are no finite numbers')
    low, high = region.min(axis=0), region.max(axis=0)
    if low[0] >= width or low[1] >= height or high[0] <= 0 or high[1] <= 0:
        raise SegmentationError(
            'the region lies outside the image: x {:.0f} to {:.0f}, y {:.0f} to {:.0f}; the image '
            'is {} x {}'.format(low[0], high[0], low[1], high[1], width, height)
        )
    inside = np.zeros((height, width), np.uint8)
    cv2.fillPoly(inside, _polygon(np.clip(region, -1e4, 1e4)), (1.0,))
    columns, rows = np.flatnonzero(inside.any(axis=0)), np.flatnonzero(inside.any(axis=1))
    if len(columns) < LEAST_SIDE or len(rows) < LEAST_SIDE:
        raise SegmentationError(
            'the region is too small: {} x {} px inside the image; it needs {} x {}'.format(
                len(columns), len(rows), LEAST_SIDE, LEAST_SIDE
            )
        )
    return inside.astype(bool)


def _around(inside: np.ndarray, share: float, least: int) -> Corners:
    """The rectangle around the region, with a margin of a share of its sides."""
    columns, rows = np.flatnonzero(inside.any(axis=0)), np.flatnonzero(inside.any(axis=1))
    across = max(least, int(share * len(columns)))
    down = max(least, int(share * len(rows)))
    return (
        max(0, columns[0] - across),
        max(0, rows[0] - down),
        min(inside.shape[1], columns[-1] + 1 + across),
        min(inside.shape[0], rows[-1] + 1 + down),
    )


def _points(image: CameraImage, crop: Corners) -> np.ndarray:
    left, top, right, bottom = crop
    return points_of(
        image.depth[top:bottom, left:right], image.intrinsics, image.base_from_camera, (left, top)
    )


def _surface(image: CameraImage, inside: np.ndarray, crop: Corners) -> Optional[Plane]:
    """The surface that the object stands on, where enough of it is seen around the region.

    Inside the region, the top of the object may be level too.
    """
    left, top, right, bottom = crop
    points = _points(image, crop)[~inside[top:bottom, left:right]]
    points = points[np.isfinite(points[:, 2])]
    return find_plane(points, np.random.default_rng(1), least=max(150, len(points) // 12))


def _grab_cut(
    image: CameraImage,
    inside: np.ndarray,
    crop: Corners,
    strokes: Sequence[Stroke],
    surface: Optional[Plane],
) -> np.ndarray:
    """(h, w) bool."""
    left, top, right, bottom = crop
    known = np.where(inside, cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    if surface is not None:
        height = surface.height(_points(image, crop))
        below = np.zeros(inside.shape, bool)
        below[top:bottom, left:right] = height < ON_SURFACE  # False where it is not known
        known[inside & below] = cv2.GC_PR_BGD
    for stroke in strokes:
        _draw(known, stroke)
    labels = known[top:bottom, left:right].copy()
    colour = np.ascontiguousarray(image.colour[top:bottom, left:right, ::-1])
    mask = np.zeros(inside.shape, bool)
    mask[top:bottom, left:right] = _labelled(colour, labels)
    area, least = int(inside.sum()), int(max(LEAST_MASK, LEAST_SHARE * inside.sum()))
    if mask.sum() < least:
        raise SegmentationError(
            'the mask collapsed to {} of the {} px of the region, {} are needed: draw a stroke '
            'on the object, or the region closer around it'.format(int(mask.sum()), area, least)
        )
    return mask


def _labelled(colour: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """(h, w) bool: what GrabCut takes for the object."""
    height, width = labels.shape
    scale = min(1.0, np.sqrt(WORK_AREA / (height * width)))
    small = (max(8, int(width * scale)), max(8, int(height * scale)))
    if scale < 1.0:
        colour = cv2.resize(colour, small, interpolation=cv2.INTER_AREA)
        labels = cv2.resize(labels, small, interpolation=cv2.INTER_NEAREST)
    object_there = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))
    if not object_there.any() or object_there.all():
        return cv2.resize(object_there.astype(np.uint8), (width, height)).astype(bool)
    cv2.setNumThreads(1)
    cv2.setRNGSeed(1)
    cv2.grabCut(
        colour,
        labels,
        _NO_RECTANGLE,
        np.zeros((1, 65)),
        np.zeros((1, 65)),
        ITERATIONS,
        cv2.GC_INIT_WITH_MASK,
    )
    found = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.float32)
    if scale < 1.0:
        found = np.asarray(cv2.resize(found, (width, height), interpolation=cv2.INTER_LINEAR))
    return found > 0.5


def _draw(known: np.ndarray, stroke: Stroke) -> None:
    points = np.asarray(stroke.points, float)
    if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not np.isfinite(points).all():
        raise SegmentationError('a stroke needs one point or more, each with a finite x and y')
    if not (np.isfinite(stroke.width) and 0 <= stroke.width <= 1000):
        raise SegmentationError(
            'a stroke has a width of {} px; allowed: 0 to 1000'.format(stroke.width)
        )
    value = cv2.GC_FGD if stroke.foreground else cv2.GC_BGD
    width = max(1, int(round(stroke.width or STROKE_WIDTH)))
    if len(points) == 1:
        points = np.repeat(points, 2, axis=0)
    cv2.polylines(known, _polygon(np.clip(points, -1e4, 1e4)), False, (float(value),), width)


def _with_depth(image: CameraImage, mask: np.ndarray, surface: Optional[Plane]) -> SegmentedObject:
    crop = _around(mask, 0.0, 1)
    left, top, right, bottom = crop
    points = _points(image, crop)
    chosen = mask[top:bottom, left:right] & np.isfinite(points[..., 2])
    known, total = int(chosen.sum()), int(mask.sum())
    if known < LEAST_DEPTH or known < LEAST_DEPTH_SHARE * total:
        raise SegmentationError(
            'too little depth on the object: {} of its {} px have one, {} are needed'.format(
                known, total, max(LEAST_DEPTH, int(np.ceil(LEAST_DEPTH_SHARE * total)))
            ),
            mask,
        )
    found = object_above(points[chosen], surface, ON_SURFACE)
    if found is None or int(found.chosen.sum()) < LEAST_DEPTH:
        raise SegmentationError(
            'nothing under the mask stands out from the surface around it', mask
        )
    return SegmentedObject(
        mask,
        found.box,
        points[chosen][found.chosen],
        image.colour[top:bottom, left:right][chosen][found.chosen],
        found.surface,
    )


def _polygon(points: np.ndarray) -> List[Any]:
    """Points (n, 2) px as OpenCV draws them: a list of one array (n, 1, 2)."""
    return [np.round(points).astype(np.int32).reshape(-1, 1, 2)]
