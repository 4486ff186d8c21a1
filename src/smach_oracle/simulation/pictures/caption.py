"""Captions of a video: a strip below each image, with a heading and up to two lines of details."""

import textwrap
from functools import lru_cache
from typing import List, NamedTuple, Tuple

import cv2
import numpy as np

HEIGHT = 64  # pixels
GREY, RED, BLUE = (85, 90, 98), (200, 45, 40), (35, 90, 190)
ORANGE, GREEN = (205, 120, 20), (40, 140, 70)
PAPER, INK = (255, 255, 255), (45, 48, 54)
BAR = 8  # pixels, the strip of colour at the left
LEFT = 18  # pixels, where the text begins
FINER = 4  # times more pixels are drawn, each way, than shown
FONT = cv2.FONT_HERSHEY_DUPLEX
HEADING_SIZE, DETAIL_SIZE = 0.52, 0.4
BASELINES = (19, 38, 55)  # pixels from above


class Caption(NamedTuple):
    """The text below an image. It has no line breaks of its own."""

    heading: str
    detail: str = ''
    colour: Tuple[int, int, int] = GREY  # RGB, of bar and heading


def captioned(image: np.ndarray, caption: Caption) -> np.ndarray:
    """(h, w, 3) uint8 RGB: an image with a strip below it."""
    return np.vstack([image, strip(caption, image.shape[1])])


@lru_cache(maxsize=8)
def strip(caption: Caption, width: int) -> np.ndarray:
    """(HEIGHT, width, 3) uint8 RGB: the strip with a caption. Too much detail ends in '...'."""
    drawn = np.full((FINER * HEIGHT, FINER * width, 3), PAPER, np.uint8)
    drawn[:, : FINER * BAR] = caption.colour
    _write(drawn, caption.heading, BASELINES[0], HEADING_SIZE, caption.colour, 2)
    for line, baseline in zip(_lines(caption.detail, width - LEFT - BAR), BASELINES[1:]):
        _write(drawn, line, baseline, DETAIL_SIZE, INK, 1)
    return cv2.resize(drawn, (width, HEIGHT), interpolation=cv2.INTER_AREA)


def _write(
    drawn: np.ndarray,
    text: str,
    baseline: int,
    size: float,
    colour: Tuple[int, int, int],
    weight: int,
) -> None:
    # Hershey fonts have ASCII alone
    cv2.putText(
        drawn,
        text.encode('ascii', 'replace').decode(),
        (FINER * LEFT, FINER * baseline),
        FONT,
        FINER * size,
        colour,
        weight * FINER // 2,
        cv2.LINE_AA,
    )


def _lines(text: str, width: int) -> List[str]:
    """Two lines at most, none wider than about so many pixels."""
    (wide, _), _ = cv2.getTextSize(text, FONT, DETAIL_SIZE, 1)
    longest = len(text) if wide <= width else int(0.97 * len(text) * width / wide)
    return textwrap.wrap(text, max(longest, 8), max_lines=2, placeholder=' ...')
