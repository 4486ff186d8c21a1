"""Failure rates and durations as text for a terminal. Pure."""

import colorsys
import math

from rich.text import Text

CLASS_NAMES = {0: '', 1: 'LOW', 2: 'MODERATE', 3: 'HIGH'}
_FULL, _EMPTY = '█', '░'


def rate_colour(rate: float) -> str:
    """Return a colour from green at 0 through yellow to red at 1, as #rrggbb.

    It can be read on dark and on light ground.
    """
    hue = (1.0 - _share(rate)) / 3.0  # a third of the circle: green
    channels = colorsys.hls_to_rgb(hue, 0.42, 0.9)
    return '#' + ''.join('{:02x}'.format(round(255 * channel)) for channel in channels)


def rate_bar(rate: float, width: int = 10) -> Text:
    """Return a bar and a percentage in the rate's colour."""
    filled = round(_share(rate) * width)
    return Text(
        '{}{} {:3.0f}%'.format(_FULL * filled, _EMPTY * (width - filled), 100 * rate),
        rate_colour(rate),
    )


def _share(rate: float) -> float:
    """Return a rate between 0 and 1. What is no number is 0."""
    return min(max(0.0, rate), 1.0)


def duration(seconds: float) -> str:
    """Return seconds as people read them: 8 s, 2:05 min, 1:30 h. ? where they are not finite."""
    if not math.isfinite(seconds):
        return '?'
    whole = max(0, int(seconds))
    if whole < 60:
        return '{} s'.format(whole)
    if whole < 3600:
        return '{}:{:02} min'.format(whole // 60, whole % 60)
    return '{}:{:02} h'.format(whole // 3600, whole % 3600 // 60)
