"""The changes with the hours of a run: light, calibration, wear.

A run is a robot that goes on for hours in one world. All this is a function of the run's seed and
of the hour, so that a run can go on from any hour. Hour 0 is the beginning of a day of work.
The page doc/protocol.md says why it is so.
"""

from typing import Callable, List, NamedTuple, Tuple

import numpy as np

from .chance import generator_for
from .light_causes import cloud_minutes

DAY_H = 10.0  # hours of work a day
# h of the day, earliest and latest, at which the sun begins to stand low in the window
SUN_LOW = ((0.0, 1.5), (8.0, 9.5))
SUNNY = 0.5  # chance that no cloud is before it then
SUN_MINUTES = (30.0, 90.0)
CLOUDS = 2.0  # a day, in the mean, that make the room dim
BRIGHTNESS = (0.1, 0.4)  # of the light that a cloud leaves
DRIFT_H = 4.0  # from one set of errors of calibration to another, independent one
WEAR = (0.005, 0.015)  # least and most, of the friction of new finger tips, that an hour takes
MOST_WEAR = 0.5
MOST = 2.0  # sigmas

Values = Tuple[Tuple[str, float], ...]


class Spell(NamedTuple):
    """Light that makes it hard to see, for a time."""

    kind: str  # of the cause: 'glare' or 'dim_light'
    begins: float  # h of the run
    ends: float
    values: Values  # of the disturbance that it is


def spells(
    seed: int, begins: float, ends: float, dazzle: Callable[[np.random.Generator], Values]
) -> List[Spell]:
    """Return the spells that have a part in some hours of a run.

    :param dazzle: draws the values of a glare, its duration excepted.
    """
    found = [
        spell
        for day in range(int(begins // DAY_H), int(ends // DAY_H) + 1)
        for spell in _of_a_day(seed, day, dazzle)
    ]
    return [spell for spell in found if spell.begins < ends and spell.ends > begins]


def _of_a_day(seed: int, day: int, dazzle: Callable[[np.random.Generator], Values]) -> List[Spell]:
    morning, found = day * DAY_H, []
    for number, window in enumerate(SUN_LOW):
        generator = generator_for(seed, 'sun:{}:{}'.format(day, number))
        begins = morning + float(generator.uniform(*window))
        ends = begins + float(generator.uniform(*SUN_MINUTES)) / 60
        if generator.random() < SUNNY:
            found.append(Spell('glare', begins, min(ends, morning + DAY_H), dazzle(generator)))
    generator = generator_for(seed, 'clouds:{}'.format(day))
    for begins in np.sort(generator.uniform(0.0, DAY_H, int(generator.poisson(CLOUDS)))):
        ends = float(begins) + cloud_minutes(generator) / 60
        found.append(
            Spell(
                'dim_light',
                morning + float(begins),
                morning + min(ends, DAY_H),
                (('brightness', float(generator.uniform(*BRIGHTNESS))),),
            )
        )
    return found


def drifting(seed: int, what: str, hour: float, count: int) -> np.ndarray:
    """(count,) sigmas of errors that change slowly, with the same spread at every hour.

    :param what: a name of the errors.
    """
    knot, part = divmod(hour / DRIFT_H, 1.0)
    before, after = (
        generator_for(seed, '{}:{}'.format(what, int(knot) + later)).normal(0.0, 1.0, count)
        for later in range(2)
    )
    turn = part * np.pi / 2
    return np.clip(np.cos(turn) * before + np.sin(turn) * after, -MOST, MOST)


def worn(seed: int, hour: float) -> float:
    """Return the share of their friction that the finger tips have lost."""
    an_hour = float(generator_for(seed, 'wear').uniform(*WEAR))
    return min(MOST_WEAR, an_hour * hour)
