"""Decides which values are numbers. Pure. True and False are not."""

import math
import sys


def is_number(value: object, low: float = -math.inf, high: float = math.inf) -> bool:
    """Whether `value` is a finite number from `low` to `high`."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    # no float holds a whole number of hundreds of digits
    return low <= value <= high and abs(value) <= sys.float_info.max


def is_whole(value: object, low: float = -math.inf, high: float = math.inf) -> bool:
    """Whether `value` is an int from `low` to `high`."""
    return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high
