"""A panel's looks: a dark frame, a white plate, a dial with a red needle, a number in cells."""

import math

import cv2
import numpy as np

from ..site import CELLS, DIAL, FRAME, GAUGE_RANGE, NEEDLE, SWEEP, ZERO_ANGLE

SIDE = 240  # px
DARK, WHITE, BLACK, RED = (38, 42, 58), (222, 222, 216), (25, 25, 25), (205, 30, 30)


def painted(number: int, reading: float) -> np.ndarray:
    """(SIDE, SIDE, 3) uint8 RGB: the front of a panel. `reading` in bar."""
    image = np.full((SIDE, SIDE, 3), WHITE, np.uint8)
    cv2.rectangle(image, (0, 0), (SIDE - 1, SIDE - 1), DARK, 2 * int(FRAME * SIDE))
    middle = (int(DIAL[0] * SIDE), int(DIAL[1] * SIDE))
    cv2.circle(image, middle, int(DIAL[2] * SIDE), BLACK, 3, cv2.LINE_AA)
    for bar in range(int(GAUGE_RANGE) + 1):
        _line(image, bar, 0.25, 0.28, BLACK, 3)
    _line(image, reading, NEEDLE[0] - 0.05, NEEDLE[1], RED, 9)
    for digit, (x, y, size) in enumerate(CELLS):
        half = int(0.5 * size * SIDE)
        corner = (int(x * SIDE) - half, int(y * SIDE) - half)
        cv2.rectangle(
            image,
            corner,
            (corner[0] + 2 * half, corner[1] + 2 * half),
            BLACK,
            cv2.FILLED if number >> digit & 1 else 2,
        )
    return image


def _line(
    image: np.ndarray, reading: float, inner: float, outer: float, colour: tuple, width: int
) -> None:
    """A line along the radius at a reading. Both ends in shares of a side from the middle."""
    angle = ZERO_ANGLE - SWEEP * reading / GAUGE_RANGE
    ends = [
        (
            int(SIDE * (DIAL[0] + share * math.cos(angle))),
            int(SIDE * (DIAL[1] - share * math.sin(angle))),
        )
        for share in (inner, outer)
    ]
    cv2.line(image, ends[0], ends[1], colour, width, cv2.LINE_AA)
