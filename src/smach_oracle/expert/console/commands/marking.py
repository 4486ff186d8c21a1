"""Commands to mark an object through a perception interface, and to end any interface. Pure."""

import re
from typing import Callable, Dict, List, NamedTuple, Tuple

import genpy

from .checks import QUESTION, CommandSpec, flag, number, one_of, outputs, seen, shown, text

AT_GOAL, FRESH = 'at_goal', 'fresh'
MOST_CORNERS = 2000
MOST_STROKES = 64
MOST_STROKE_POINTS = 1000
_FURTHEST = 20000.0  # px
_WIDEST = 400.0  # px, of a stroke
_STAMP = re.compile(r'(\d{1,10})\.(\d{9})')

Point = Tuple[float, float]


class StrokeArgument(NamedTuple):
    """A line on the image."""

    foreground: bool  # it lies on the object
    width: float  # px
    points: List[Point]  # px: right, down


def _points(least: int, most: int) -> Callable[[object], List[Point]]:
    coordinate = number(-_FURTHEST, _FURTHEST)

    def check(value: object) -> List[Point]:
        if not isinstance(value, list) or not least <= len(value) <= most:
            raise ValueError(
                '{} is not allowed; allowed: {} to {} points [x, y]'.format(
                    shown(value), least, most
                )
            )
        if not all(isinstance(point, list) and len(point) == 2 for point in value):
            raise ValueError('a point is [x, y]')
        return [(coordinate(x), coordinate(y)) for x, y in value]

    return check


def _strokes(value: object) -> List[StrokeArgument]:
    if not isinstance(value, list) or len(value) > MOST_STROKES:
        raise ValueError('"strokes" is a list of at most {} lines'.format(MOST_STROKES))
    return [_stroke(each) for each in value]


def _stroke(value: object) -> StrokeArgument:
    if not isinstance(value, dict) or set(value) != {'foreground', 'width', 'points'}:
        raise ValueError('a stroke is {"foreground": ..., "width": ..., "points": ...}')
    return StrokeArgument(
        flag(value['foreground']),
        number(0.5, _WIDEST)(value['width']),
        _points(1, MOST_STROKE_POINTS)(value['points']),
    )


def _stamp(value: object) -> genpy.Time:
    found = _STAMP.fullmatch(value) if isinstance(value, str) else None
    if found is None or int(found.group(1)) >= 2**32:
        raise ValueError(
            '{} is not allowed; allowed: the stamp of an image, as seconds.nanoseconds'.format(
                shown(value)
            )
        )
    return genpy.Time(int(found.group(1)), int(found.group(2)))


MARKING_COMMANDS: Dict[str, CommandSpec] = {
    'mark': CommandSpec(
        'operator', dict(QUESTION, stamp=_stamp, region=_points(3, MOST_CORNERS), strokes=_strokes)
    ),
    'use_frame': CommandSpec('operator', dict(QUESTION, frame=one_of((AT_GOAL, FRESH)))),
    'hand_over': CommandSpec(
        'operator', dict(QUESTION, outcome=text(400, 1), outputs=outputs, why=text(2000), seen=seen)
    ),
    'give_up_interface': CommandSpec('operator', dict(QUESTION, why=text(2000))),
}
