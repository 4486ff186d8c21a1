"""The things a person recognises in an image of the head camera: outlines of what is visible.

It goes by the pixels that show a thing, and by whether their colours can be told apart: nothing is
recognised in the dark or in a glare. The outlines err as those that people draw.
"""

import zlib
from typing import Dict, Mapping, NamedTuple, Sequence

import numpy as np
from scipy import ndimage

from .world import World

DARK, DAZZLING = 9.0, 250.0  # of 255: means around a pixel between which its colour can be told
AROUND = 5  # px, of these means
LEAST = 0.0008  # share of the image's pixels that must show a thing
SHARE_SEEN = 0.25  # of the pixels that show it, whose colours can be told
USUAL_WIDTH = 640.0  # px of an image. A small one is shown as large as any
MISSED = 2.0  # px of such an image, sigma by which an outline errs, on the whole and here and there
SMOOTH = 14.0  # px along which the error changes


class SeenView(NamedTuple):
    """An image as its world knows it."""

    colour: np.ndarray  # (h, w, 3) uint8, as it was published
    labels: np.ndarray  # (h, w) number of the body that each pixel shows
    names: Mapping[int, str]  # of bodies, by number
    moment: int  # control periods since the reset
    seed: int  # of the trial


def view_of(world: World, colour: np.ndarray) -> SeenView:
    """The view of the image that was taken last.

    :param colour: (h, w, 3) uint8, that image.
    """
    numbers = np.unique(world.labels)
    names = {int(number): world.seen_as(int(number)) for number in numbers}
    return SeenView(
        colour,
        world.labels,
        {number: name for number, name in names.items() if name not in ('', 'floor')},
        world.periods,
        world.scene.seed,
    )


def chance_of(seed: int) -> int:
    """A number for what a person gets wrong, which repeats with the trial."""
    return zlib.crc32('a person in trial {}'.format(seed).encode())


def recognised(view: SeenView, names: Sequence[str]) -> Dict[str, np.ndarray]:
    """Outlines (h, w) bool of those of the named things that can be recognised."""
    told = legible(view.colour)
    found = {}
    for number, name in sorted(view.names.items(), key=lambda item: item[1]):
        shown = view.labels == number
        pixels = int(shown.sum())
        seen = int((shown & told).sum())
        if name in names and seen >= max(LEAST * shown.size, SHARE_SEEN * pixels, 1):
            outline = drawn(
                shown & ndimage.binary_dilation(told, iterations=2),
                np.random.default_rng([view.seed, 103, view.moment, zlib.crc32(name.encode())]),
            )
            if outline.any():
                found[name] = outline
    return found


def legible(colour: np.ndarray) -> np.ndarray:
    """(h, w) bool: where colours can be told: it is neither too dark there nor dazzling."""
    means = ndimage.uniform_filter(colour.astype(np.float32), (AROUND, AROUND, 1))
    return np.asarray((means.max(axis=2) > DARK) & (means.min(axis=2) < DAZZLING))


def drawn(shown: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """An outline (h, w) bool around pixels (h, w) bool, as a hand draws it."""
    scale = shown.shape[1] / USUAL_WIDTH
    depth = ndimage.distance_transform_edt(shown) - ndimage.distance_transform_edt(~shown)
    rough = ndimage.gaussian_filter(generator.standard_normal(shown.shape), SMOOTH * scale)
    missed = rough / max(float(rough.std()), 1e-9) + 0.5 * generator.standard_normal()
    return np.asarray(depth > MISSED * scale * missed)
