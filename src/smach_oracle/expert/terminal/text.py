"""Failure rates and durations as text for a terminal. Pure."""

import colorsys

from rich.text import Text

CLASS_NAMES = {0: '', 1: 'LOW', 2: 'MODERATE', 3: 'HIGH'}
_FULL, _EMPTY = '█', '░'


def rate_colour(rate: float) -> str:
    """Return a colour from green at 0 through yellow to red at 1, as #rrggbb.

    It can be read on dark and on light ground.
    """
    hue = (1.0 - min(max(rate, 0.0), 1.0)) / 3.0  # a third of the circle: green
    channels = colorsys.hls_to_rgb(hue, 0.42, 0.9)
    return '#' + ''.join('{:02x}'.format(round(255 * channel)) for channel in channels)


def rate_bar(rate: float, width: int = 10) -> Text:
    """Return a bar and a percentage in the rate's colour."""
    filled = round(min(max(rate, 0.0), 1.0) * width)
    return Text(
        '{}{} {:3.0f}%'.format(_FULL * filled, _EMPTY * (width - filled), 100 * rate),
        rate_colour(rate),
    )


def duration(seconds: float) -> str:
    """Return seconds as people read them: 8 s, 2:05 min, 1:30 h."""
    whole = max(0, int(seconds))
    if whole < 60:
        return '{} s'.format(whole)
    if whole < 3600:
        return '{}:{:02} min'.format(whole // 60, whole % 60)
    return '{}:{:02} h'.format(whole // 3600, whole % 3600 // 60)
