"""Shows a thing in the camera's image as a person does: a hasty rectangle, then strokes."""

from typing import Callable, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .seen_scene import Region, SeenThing

_USUAL_WIDTH = 640.0  # px of an image, for which these are
_EDGE_SIGMA = 2.5  # px, by which a person misses each edge of the rectangle
_MARGIN = 6  # px that a person leaves around it
_ALIKE = 0.55  # of the pixels of mask and outline together, that both must have
_TRIES = 4


class OperatorStroke(NamedTuple):
    """A stroke."""

    foreground: bool
    points: Sequence[Tuple[float, float]]  # px


class MarkedResult(NamedTuple):
    """The interface's answer to a drawing."""

    ok: bool
    message: str
    mask: Optional[np.ndarray]  # (h, w) bool, as it is shown to people. None means there is none


SegmentCall = Callable[[Region, Sequence[OperatorStroke]], MarkedResult]


Look = Callable[[], Optional[SeenThing]]


def show(
    segment: SegmentCall, thing: SeenThing, generator: np.random.Generator, look_again: Look
) -> str:
    """Mark a thing until the mask looks right.

    :param look_again: shows another image, between two tries, and finds the thing there.
    :returns: '', else what is wrong with the last mask.
    """
    wrong = ''
    for number in range(_TRIES):
        seen = look_again() if number else thing
        if seen is None:
            return 'nothing of it can be seen'
        image = seen.mask.shape[1], seen.mask.shape[0]
        strokes = strokes_on(seen.region, generator) if number % 2 else ()
        marked = segment(rectangle(seen.region, image, generator), strokes)
        wrong = marked.message or 'no object' if not marked.ok else looks_wrong(marked, seen)
        if not wrong:
            return ''
    return wrong


def rectangle(region: Region, image: Tuple[int, int], generator: np.random.Generator) -> Region:
    """A rectangle about a region (px), drawn by hand, within the image."""
    left, top, width, height = region
    scale = image[0] / _USUAL_WIDTH  # a small image is shown as large as any
    missed, margin = scale * generator.normal(0.0, _EDGE_SIGMA, 4), scale * _MARGIN
    x, right = (
        int(np.clip(round(edge), 0, image[0]))
        for edge in (left - margin + missed[0], left + width + margin + missed[1])
    )
    y, bottom = (
        int(np.clip(round(edge), 0, image[1]))
        for edge in (top - margin + missed[2], top + height + margin + missed[3])
    )
    return x, y, max(right - x, 1), max(bottom - y, 1)


def strokes_on(region: Region, generator: np.random.Generator) -> Tuple[OperatorStroke, ...]:
    """A line down the middle of the thing, and dots next to it that are not part of it."""
    left, top, width, height = region
    middle = left + width / 2 + generator.normal(0.0, 0.05) * width
    inside = OperatorStroke(True, [(middle, top + 0.25 * height), (middle, top + 0.75 * height)])
    beside = [
        OperatorStroke(False, [(x, top + height / 2)])
        for x in (left - 5.0, left + width + 5.0)
        if x >= 0.0
    ]
    return (inside,) + tuple(beside)


def looks_wrong(marked: MarkedResult, thing: SeenThing) -> str:
    """Return why a person rejects a mask: it is not what they see of the thing. Else ''."""
    if marked.mask is None or marked.mask.shape != thing.mask.shape:
        return 'no mask is shown'
    both, either = (marked.mask & thing.mask).sum(), (marked.mask | thing.mask).sum()
    alike = float(both) / max(int(either), 1)
    return (
        ''
        if alike >= _ALIKE
        else 'the mask shares {:.0f}% with what is seen of it'.format(100 * alike)
    )
