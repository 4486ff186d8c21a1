"""The commands with which a person drives a robot's hand through a manipulation interface. Pure."""
import math
from typing import Any, Dict, Tuple

from .checks import QUESTION, Spec, one_of, shown, text

FRAMES = ('tool', 'base', 'camera')
GRIPPER = ('', 'open', 'close')
_LONGEST_PAGE_MS = 1e12  # age of a page


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError('{} is not allowed; allowed: true, false'.format(shown(value)))
    return value


def _is_number(value: Any, least: float, most: float) -> bool:
    return (isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
            and least <= value <= most)


def _axes(value: Any) -> Tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3 or not all(_is_number(each, -1.0, 1.0) for each in value):
        raise ValueError('{} is not allowed; allowed: three numbers from -1 to 1'.format(shown(value)))
    return float(value[0]), float(value[1]), float(value[2])


def _milliseconds(value: Any) -> float:
    if not _is_number(value, 0.0, _LONGEST_PAGE_MS):
        raise ValueError('{} is not allowed; allowed: milliseconds from 0'.format(shown(value)))
    return float(value)


HAND_COMMANDS: Dict[str, Spec] = {
    'take_wheel': Spec('teleoperator', QUESTION),
    'leave_wheel': Spec('teleoperator', QUESTION),
    # forward, left, up; and turns about these: shares of the interface's own limits. sent: the page's clock.
    # arm: one of the interface's own, which are checked there; '': the one that it has chosen for the state
    'drive': Spec('teleoperator', dict(QUESTION, held=_flag, frame=one_of(FRAMES), linear=_axes, angular=_axes,
                                       gripper=one_of(GRIPPER), sent=_milliseconds, arm=text(100))),
}
