"""The colours of things, by their hue and by their shares of red, green and blue."""

from typing import List, Tuple

import numpy as np

# degrees of hue from which each name counts, up to the next one's. Red passes 360
HUES: List[Tuple[float, str]] = [
    (0.0, 'red'),
    (18.0, 'orange'),
    (43.0, 'yellow'),
    (68.0, 'green'),
    (165.0, 'turquoise'),
    (205.0, 'blue'),
    (262.0, 'purple'),
    (335.0, 'red'),
]
GREY = 'grey'
NAMES = tuple(sorted({name for _, name in HUES} | {GREY}))
LEAST_SATURATION = 0.25  # less is grey
# of the brightest channel, of 255: in what is darker noise is as strong as colour
DARKEST = 24.0
SAME = 0.09  # difference of shares of red, green or blue that one thing may have in two images
# the same, of single points, which have the noise of the camera
SAME_POINT = 0.16


def names_of(colours: np.ndarray) -> np.ndarray:
    """The colours' names, (...,) of text, or '' for what is too dark to tell.

    :param colours: (..., 3), red, green and blue, 0 to 255.
    """
    values = np.asarray(colours, float)
    highest, lowest = values.max(axis=-1), values.min(axis=-1)
    spread = np.maximum(highest - lowest, 1e-9)
    red, green, blue = np.moveaxis(values, -1, 0)
    hue = (
        np.where(
            highest == red,
            (green - blue) / spread % 6.0,
            np.where(highest == green, (blue - red) / spread + 2.0, (red - green) / spread + 4.0),
        )
        * 60.0
    )
    starts = np.array([start for start, _ in HUES])
    named = np.array([name for _, name in HUES])[np.searchsorted(starts, hue, side='right') - 1]
    named = np.where(highest - lowest < LEAST_SATURATION * highest, GREY, named)
    return np.where(highest < DARKEST, '', named)


def name_of(colour: np.ndarray) -> str:
    """Return the name of one colour (3,). See names_of()."""
    return str(names_of(np.asarray(colour)))


def unlikeness(colours: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return how much the shares of red, green and blue differ, 0 to 1, in whatever light.

    :param colours: (..., 3).
    :param other: (3,).
    """
    return np.asarray(np.abs(_shares(colours) - _shares(other)).max(axis=-1))


def _shares(colours: np.ndarray) -> np.ndarray:
    values = np.asarray(colours, float)
    return np.asarray(values / np.maximum(values.sum(axis=-1, keepdims=True), 1e-9))
