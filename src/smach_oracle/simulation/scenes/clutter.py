"""Other things on a table: of other shapes and colours than cans and cartons."""

import colorsys
from typing import Callable, Sequence, Tuple

import numpy as np

from .scene import Body, Vector

Drawn = Tuple[str, Vector, float]  # shape, size, kg


def _cup(generator: np.random.Generator) -> Drawn:
    wide = float(generator.uniform(0.070, 0.090))
    return 'cup', (wide, wide, float(generator.uniform(0.08, 0.12))), 0.12


def _bottle(generator: np.random.Generator) -> Drawn:
    wide = float(generator.uniform(0.060, 0.080))
    return 'bottle', (wide, wide, float(generator.uniform(0.18, 0.24))), 0.45


def _jar(generator: np.random.Generator) -> Drawn:
    radius = float(generator.uniform(0.035, 0.045))
    return 'cylinder', (radius, radius, float(generator.uniform(0.06, 0.10))), 0.35


def _ball(generator: np.random.Generator) -> Drawn:
    wide = float(generator.uniform(0.07, 0.10))
    return 'round', (wide, wide, float(generator.uniform(0.07, 0.09))), 0.20


def _packet(generator: np.random.Generator) -> Drawn:
    size = (
        float(generator.uniform(0.08, 0.11)),
        float(generator.uniform(0.045, 0.06)),
        float(generator.uniform(0.05, 0.20)),
    )
    return 'box', size, 0.40


MAKERS: Sequence[Callable[[np.random.Generator], Drawn]] = (_cup, _bottle, _jar, _ball, _packet)
# of things beside the one that is to be picked
OTHER_SHARE = 0.6


def another(generator: np.random.Generator, thing: Body, floor: float) -> Body:
    """Perhaps something else in a thing's place. Its name stays.

    :param floor: m, the height on which it stands.
    """
    if generator.random() >= OTHER_SHARE:
        return thing
    shape, size, mass = MAKERS[int(generator.integers(len(MAKERS)))](generator)
    place = (thing.position[0], thing.position[1], floor + size[2] / 2 + 0.001)
    return thing._replace(
        shape=shape,
        size=size,
        mass=mass,
        position=place,
        colour=_colour(generator),
        yaw=float(generator.uniform(-1.5, 1.5)),
    )


def _colour(generator: np.random.Generator) -> Vector:
    """Any colour that is neither black nor glaring."""
    red, green, blue = colorsys.hsv_to_rgb(
        float(generator.random()),
        float(generator.uniform(0.1, 0.9)),
        float(generator.uniform(0.35, 0.95)),
    )
    return red, green, blue
