"""Shows a thing in the camera's image as a person does: a hasty rectangle, then strokes."""
from typing import Callable, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .true_scene import TrueBody, TrueScene

LEAST_VISIBLE = 0.35  # share of a thing's outline that must be free, to show it
LEAST_PIXELS = 12  # px of its width and height
_USUAL_WIDTH = 640.0  # px of an image, for which these are
_EDGE_SIGMA = 2.5  # px, by which a person misses each edge of the rectangle
_MARGIN = 6  # px that a person leaves around it
_TOO_FAR = 0.025  # m between the marked and the true middle that a person lets pass
_TOO_LARGE = 0.035  # m between the marked and the true extents
_TRIES = 4

Region = Tuple[int, int, int, int]  # px: x, y, width, height


class OperatorStroke(NamedTuple):
    """A stroke."""

    foreground: bool
    points: Sequence[Tuple[float, float]]  # px


class MarkedResult(NamedTuple):
    """The interface's answer to a drawing."""

    ok: bool
    message: str
    centre: np.ndarray  # (3,) m, in base_footprint
    size: np.ndarray  # (3,) m


SegmentCall = Callable[[Region, Sequence[OperatorStroke]], MarkedResult]


def what_to_show(scene: TrueScene) -> Optional[TrueBody]:
    """The nearest thing that can be seen well enough, which a task would take next; or None."""
    seen = [
        body for body in scene.movable()
        if body.visible >= LEAST_VISIBLE and min(body.region[2:]) >= LEAST_PIXELS and not body.held
        and (not scene.goal_body or body.name == scene.goal_body)
    ]
    if not seen:
        return None
    return min(seen, key=lambda body: float(np.hypot(*body.centre[:2])))


def show(segment: SegmentCall, thing: TrueBody, image: Tuple[int, int],
         generator: np.random.Generator, refresh: Callable[[], None]) -> str:
    """Mark a thing until the mask looks right.

    :param image: its width and height, px.
    :param refresh: asks for another image, between two tries: glare passes.
    :returns: '', else what is wrong with the last mask.
    """
    wrong = ''
    for number in range(_TRIES):
        if number:
            refresh()
        strokes = strokes_on(thing.region, generator) if number % 2 else ()
        marked = segment(rectangle(thing.region, image, generator), strokes)
        wrong = marked.message or 'no object' if not marked.ok else looks_wrong(marked, thing)
        if not wrong:
            return ''
    return wrong


def rectangle(region: Region, image: Tuple[int, int], generator: np.random.Generator) -> Region:
    """A rectangle about a region (px), drawn by hand, within the image."""
    left, top, width, height = region
    scale = image[0] / _USUAL_WIDTH  # a small image is shown as large as any
    missed, margin = scale * generator.normal(0.0, _EDGE_SIGMA, 4), scale * _MARGIN
    x, right = (int(np.clip(round(edge), 0, image[0]))
                for edge in (left - margin + missed[0], left + width + margin + missed[1]))
    y, bottom = (int(np.clip(round(edge), 0, image[1]))
                 for edge in (top - margin + missed[2], top + height + margin + missed[3]))
    return x, y, max(right - x, 1), max(bottom - y, 1)


def strokes_on(region: Region, generator: np.random.Generator) -> Tuple[OperatorStroke, ...]:
    """A line down the middle of the thing, and dots beside it that are none of it."""
    left, top, width, height = region
    middle = left + width / 2 + generator.normal(0.0, 0.05) * width
    inside = OperatorStroke(True, [(middle, top + 0.25 * height), (middle, top + 0.75 * height)])
    beside = [
        OperatorStroke(False, [(x, top + height / 2)]) for x in (left - 5.0, left + width + 5.0)
        if x >= 0.0
    ]
    return (inside,) + tuple(beside)


def looks_wrong(marked: MarkedResult, thing: TrueBody) -> str:
    """Why a person rejects a mask, or ''."""
    beside = float(np.hypot(*(marked.centre - thing.centre)[:2]))
    if beside > _TOO_FAR:
        return 'it is {:.0f} cm beside the thing'.format(100 * beside)
    larger = max(abs(np.sort(marked.size[:2]) - np.sort(np.array(thing.size)[:2])).max(),
                 abs(marked.size[2] - thing.size[2]))
    return 'it is {:.0f} cm larger or smaller than the thing'.format(
        100 * larger) if larger > _TOO_LARGE else ''
