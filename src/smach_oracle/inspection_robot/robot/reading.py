"""Finds the panel in a camera image and reads its gauge, or says why it cannot be read."""

import math
from typing import List, NamedTuple, Optional

import cv2
import numpy as np

from ..site import CELLS, DIAL, FRAME, GAUGE_RANGE, NEEDLE, SWEEP, ZERO_ANGLE

SIDE = 200  # px of the panel once it is straightened
SMALLEST = 60.0  # px: the height of a panel that is near enough
NARROWEST = 0.72  # width by height of a panel that is seen straight enough
BRIGHTEST = 0.12  # share of the plate that may be white as light
SHARPEST = 14.0  # least change of brightness across the edge of the frame
LEAST_NEEDLE = 0.35  # share of the needle's pixels that must be seen


class ReadingError(Exception):
    """The gauge cannot be read. The text says why."""


class GaugeReading(NamedTuple):
    """A reading of a panel."""

    number: int  # of the panel
    bar: float


def read(image: np.ndarray) -> GaugeReading:
    """The panel that an image shows.

    :param image: (h, w, 3) uint8 RGB.
    :raises ReadingError: where none can be read.
    """
    corners = _largest_panel(image)
    if corners is None:
        raise ReadingError(_why_none(image))
    height = 0.5 * (_length(corners, 0, 3) + _length(corners, 1, 2))
    width = 0.5 * (_length(corners, 0, 1) + _length(corners, 3, 2))
    if height < SMALLEST:
        raise ReadingError('the panel is too far off: {:.0f} pixels high'.format(height))
    if width / height < NARROWEST:
        raise ReadingError(
            'the panel is seen at a slant: {:.0f} x {:.0f} pixels'.format(width, height)
        )
    panel = _straightened(image, corners)
    _check_light(panel)
    _check_sharpness(panel)
    return GaugeReading(_number(panel), _needle(panel))


def _length(corners: np.ndarray, one: int, other: int) -> float:
    return float(np.linalg.norm(corners[one] - corners[other]))


def _largest_panel(image: np.ndarray) -> Optional[np.ndarray]:
    """(4, 2) px: the corners of a dark frame around something bright, from the upper left one."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    dark = np.less(cv2.GaussianBlur(grey, (3, 3), 0), 100).astype(np.uint8)
    found, _ = cv2.findContours(dark, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
    panels: List[np.ndarray] = []
    for contour in found:
        outline = cv2.approxPolyDP(contour, 0.04 * cv2.arcLength(contour, True), True)
        if len(outline) == 4 and cv2.isContourConvex(outline) and cv2.contourArea(outline) > 250:
            corners = _in_order(outline.reshape(4, 2).astype(np.float32))
            if _is_whole(corners, grey.shape) and _is_framed(_straightened(image, corners)):
                panels.append(corners)
    return max(panels, key=lambda each: cv2.contourArea(each), default=None)


def _in_order(corners: np.ndarray) -> np.ndarray:
    """Upper left, upper right, lower right, lower left."""
    by_x = corners[np.argsort(corners[:, 0])]
    left, right = by_x[:2], by_x[2:]
    left, right = left[np.argsort(left[:, 1])], right[np.argsort(right[:, 1])]
    return np.array([left[0], right[0], right[1], left[1]])


def _is_whole(corners: np.ndarray, shape: tuple) -> bool:
    """Whether nothing of it is cut off by the edge of the image."""
    return bool(
        (corners > 1.5).all()
        and (corners[:, 0] < shape[1] - 2.5).all()
        and (corners[:, 1] < shape[0] - 2.5).all()
    )


def _straightened(image: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(SIDE, SIDE, 3): the panel as one sees it who stands before it."""
    square = np.array([(0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE)], np.float32)
    return cv2.warpPerspective(image, cv2.getPerspectiveTransform(corners, square), (SIDE, SIDE))


def _ring(grey: np.ndarray, share: float) -> np.ndarray:
    """The pixels of a square line so far (share of a side) from the edge."""
    at = int(share * SIDE)
    inner = grey[at : SIDE - at, at : SIDE - at]
    return np.concatenate([inner[0], inner[-1], inner[:, 0], inner[:, -1]])


def _is_framed(panel: np.ndarray) -> bool:
    """Whether a dark frame is around a bright plate."""
    grey = cv2.cvtColor(panel, cv2.COLOR_RGB2GRAY)
    frame, plate = _ring(grey, 0.5 * FRAME), _ring(grey, FRAME + 0.05)
    return float(np.median(frame)) < 110 and float(np.median(plate)) > float(np.median(frame)) + 60


def _why_none(image: np.ndarray) -> str:
    lit = float((image.min(axis=2) > 250).mean())
    if lit > 0.03:
        return 'no panel is to be seen: light falls into the camera'
    return 'no panel is to be seen as a whole'


def _check_light(panel: np.ndarray) -> None:
    """:raises ReadingError: where light covers the plate."""
    edge = int((FRAME + 0.02) * SIDE)
    lit = float((panel[edge:-edge, edge:-edge].min(axis=2) > 250).mean())
    if lit > BRIGHTEST:
        raise ReadingError('light covers {:.0f}% of the panel'.format(100 * lit))


def _check_sharpness(panel: np.ndarray) -> None:
    """:raises ReadingError: where the upright edges of the frame are drawn out."""
    grey = cv2.cvtColor(panel, cv2.COLOR_RGB2GRAY).astype(float)
    rows = grey[int(0.2 * SIDE) : int(0.8 * SIDE)].mean(axis=0)
    edge = int(FRAME * SIDE)
    steps = np.abs(np.diff(rows))
    sharpness = min(steps[edge - 8 : edge + 9].max(), steps[-edge - 9 : -edge + 8].max())
    if sharpness < SHARPEST:
        raise ReadingError('the image is blurred by motion')


def _number(panel: np.ndarray) -> int:
    """:raises ReadingError: where no number is to be seen."""
    grey = cv2.cvtColor(panel, cv2.COLOR_RGB2GRAY)
    number = 0
    for digit, (x, y, size) in enumerate(CELLS):
        half = int(0.25 * size * SIDE)
        cell = grey[
            int(y * SIDE) - half : int(y * SIDE) + half + 1,
            int(x * SIDE) - half : int(x * SIDE) + half + 1,
        ]
        number |= int(cell.mean() < 110) << digit
    if not number:
        raise ReadingError('the number of the panel is covered')
    return number


def _needle(panel: np.ndarray) -> float:
    """The reading in bar.

    :raises ReadingError: where the needle is not seen.
    """
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    right, up = x - DIAL[0], DIAL[1] - y
    radius = np.maximum(np.hypot(right, up), 1e-6)
    colour: np.ndarray = panel.astype(int)
    red = colour[..., 0] - np.maximum(colour[..., 1], colour[..., 2]) > 50
    on_needle = red & (radius > NEEDLE[0]) & (radius < NEEDLE[1])
    whole = (NEEDLE[1] - NEEDLE[0]) * 0.03 * SIDE**2
    if on_needle.sum() < LEAST_NEEDLE * whole:
        raise ReadingError('the needle is not to be seen: something covers the dial')
    angle = math.atan2(
        float((up / radius)[on_needle].mean()), float((right / radius)[on_needle].mean())
    )
    # 0 to 2 pi clockwise from the middle of the gap below the dial
    turned = (1.5 * math.pi - angle) % (2 * math.pi)
    share = (turned - (1.5 * math.pi - ZERO_ANGLE)) / SWEEP
    return round(min(max(share, 0.0), 1.0) * GAUGE_RANGE, 2)
