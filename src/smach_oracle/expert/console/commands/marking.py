"""The commands with which an expert marks an object through a perception interface, and ends any interface. Pure."""
import math
import re
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

import genpy

from .checks import QUESTION, Spec, one_of, outputs, shown, text

AT_GOAL, FRESH = 'at_goal', 'fresh'
MOST_CORNERS = 2000
MOST_STROKES = 64
MOST_STROKE_POINTS = 1000
_FURTHEST = 20000.0  # px
_WIDEST = 400.0  # px, of a stroke
_STAMP = re.compile(r'(\d{1,10})\.(\d{9})')

Point = Tuple[float, float]


class DrawnStroke(NamedTuple):
    """A line on the frame."""

    foreground: bool  # it lies on the object
    width: float  # px
    points: List[Point]  # px: right, down


def _number(least: float, most: float) -> Callable[[Any], float]:
    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) \
                or not least <= value <= most:
            raise ValueError('{} is not allowed; allowed: a number from {:g} to {:g}'.format(shown(value), least, most))
        return float(value)
    return check


def _points(least: int, most: int) -> Callable[[Any], List[Point]]:
    coordinate = _number(-_FURTHEST, _FURTHEST)

    def check(value: Any) -> List[Point]:
        if not isinstance(value, list) or not least <= len(value) <= most:
            raise ValueError('{} is not allowed; allowed: {} to {} points [x, y]'.format(shown(value), least, most))
        if not all(isinstance(point, list) and len(point) == 2 for point in value):
            raise ValueError('a point is [x, y]')
        return [(coordinate(x), coordinate(y)) for x, y in value]
    return check


def _strokes(value: Any) -> List[DrawnStroke]:
    if not isinstance(value, list) or len(value) > MOST_STROKES:
        raise ValueError('"strokes" is a list of at most {} lines'.format(MOST_STROKES))
    return [_stroke(each) for each in value]


def _stroke(value: Any) -> DrawnStroke:
    if not isinstance(value, dict) or set(value) != {'foreground', 'width', 'points'}:
        raise ValueError('a stroke is {"foreground": ..., "width": ..., "points": ...}')
    if not isinstance(value['foreground'], bool):
        raise ValueError('"foreground" is true or false')
    return DrawnStroke(value['foreground'], _number(0.5, _WIDEST)(value['width']),
                       _points(1, MOST_STROKE_POINTS)(value['points']))


def _stamp(value: Any) -> genpy.Time:
    found = _STAMP.fullmatch(value) if isinstance(value, str) else None
    if found is None or int(found.group(1)) >= 2 ** 32:
        raise ValueError('{} is not allowed; allowed: the stamp of a frame, as seconds.nanoseconds'.format(
            shown(value)))
    return genpy.Time(int(found.group(1)), int(found.group(2)))


EYE_COMMANDS: Dict[str, Spec] = {
    'mark': Spec('operator', dict(QUESTION, stamp=_stamp, region=_points(3, MOST_CORNERS), strokes=_strokes)),
    'use_frame': Spec('operator', dict(QUESTION, frame=one_of((AT_GOAL, FRESH)))),
    'hand_over': Spec('operator', dict(QUESTION, outcome=text(400, 1), outputs=outputs, why=text(2000))),
    'give_up_interface': Spec('operator', dict(QUESTION, why=text(2000))),
}
