"""The differences between a trial's world and what the robot's map and its task say of it.

Someone has measured the kitchen with a tape, people move their furniture by a few centimetres, no
two cans are of one size, and nobody holds a hand where it was held yesterday.
"""

from typing import NamedTuple, Tuple

import numpy as np

from smach_oracle.pr2.kitchen import Kitchen

from .chance import generator_for
from .person import PALM
from .scene import Vector

MOST = 2.0  # sigmas
PLACE: Vector = (0.015, 0.015, 0.010)  # sigma of x, y (m) and yaw (rad) of the fridge
SHELVES = 0.006  # m, sigma of the height of all shelves together
HANDLE = 0.004  # m, sigma of where the handle is on its door
PALM_SIGMA: Vector = (0.02, 0.02, 0.012)  # m
# sigma of x, y (m) and yaw (rad) by which a localisation among walls is wrong for as long as
# nothing corrects it
LOCALISED: Vector = (0.010, 0.010, 0.006)
DRINK_RADIUS, DRINK_HEIGHT = (0.028, 0.033), (0.105, 0.130)  # m
TABLE_HEIGHT, TABLE_X, TABLE_EXTENT = 0.010, 0.015, 0.02  # m, sigmas


class TrueTable(NamedTuple):
    """A table as it is."""

    height: float  # m, of its top
    x: float  # m, of its middle
    size: Vector  # m, of its top


def true_kitchen(seed: int) -> Kitchen:
    """The kitchen as it is. The robot has Kitchen()."""
    drawn = _drawn(seed, 'true_kitchen', 6)
    mapped = Kitchen()
    x, y, yaw = (
        float(value + sigma * each) for value, sigma, each in zip(mapped.place, PLACE, drawn)
    )
    lift = SHELVES * float(drawn[3])
    return mapped._replace(
        place=(x, y, yaw),
        shelves=tuple(each + lift for each in mapped.shelves),
        handle_inset=mapped.handle_inset + HANDLE * float(drawn[4]),
        handle_stand_off=mapped.handle_stand_off + HANDLE * float(drawn[5]),
    )


def drink_size(seed: int, index: int) -> Tuple[float, float]:
    """Radius and height of a drink, m."""
    generator = generator_for(seed, 'drink_size:{}'.format(index))
    return float(generator.uniform(*DRINK_RADIUS)), float(generator.uniform(*DRINK_HEIGHT))


def true_palm(seed: int) -> Vector:
    """Return where the receiving hand is held, m."""
    return _beside(PALM, PALM_SIGMA, _drawn(seed, 'true_palm', 3))


def true_table(seed: int, height: float, x: float, size: Vector) -> TrueTable:
    """A table about as high, far and large as that (m)."""
    drawn = _drawn(seed, 'true_table', 4)
    return TrueTable(
        height + TABLE_HEIGHT * float(drawn[0]),
        x + TABLE_X * float(drawn[1]),
        (
            size[0] + TABLE_EXTENT * float(drawn[2]),
            size[1] + TABLE_EXTENT * float(drawn[3]),
            size[2],
        ),
    )


def localisation_error(seed: int) -> Vector:
    """Return the error of the robot's localisation, m and rad."""
    return _beside((0.0, 0.0, 0.0), LOCALISED, _drawn(seed, 'localisation_error', 3))


def _drawn(seed: int, what: str, count: int) -> np.ndarray:
    """(count,) sigmas."""
    return generator_for(seed, what).normal(0.0, 1.0, count).clip(-MOST, MOST)


def _beside(values: Vector, sigmas: Vector, drawn: np.ndarray) -> Vector:
    x, y, z = (float(value + sigma * each) for value, sigma, each in zip(values, sigmas, drawn))
    return x, y, z
