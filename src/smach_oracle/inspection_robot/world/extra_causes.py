"""The extra kinds of causes in the hall: one a trial where they are asked for, from its seed."""

import zlib
from typing import Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from ..site import PANELS, before_panel

SLACK_TYRE, STEAM = 'slack_tyre', 'steam'  # the first lasts, the second passes
EXTRA = (SLACK_TYRE, STEAM)
# rad for each m of way, least and most: wheels that differ by 0.4 to 1.6%
VEER = (0.01, 0.04)
VENTS_S = (6.0, 20.0)  # that a trap lets off steam
RADIUS = (0.45, 0.7)  # m, of the plume
BEFORE_S = (0.0, 10.0)  # that it begins before a robot without trouble comes
FROM_PANEL = (0.45, 0.7)  # m, from a panel to the middle of a plume before it
RETURNS = 0.6  # share of the scanner's rays into a plume that come back from within it
DEEP = 0.3  # m, at most, that they go in


class Plume(NamedTuple):
    """Steam that hides what is behind it, and throws the scanner's light back."""

    x: float  # m, of its middle
    y: float
    radius: float  # m
    begins_s: float  # of the trial
    ends_s: float


def extra_kind(seed: int) -> str:
    """Return the one kind of a trial with extra causes. Half of the trials have each."""
    return EXTRA[int(_generator(seed, 'kind').random() < 0.5)]


def veer(seed: int) -> float:
    """Draw the turn of a robot with a slack tyre, rad for each m of way."""
    generator = _generator(seed, SLACK_TYRE)
    side = 1.0 if generator.random() < 0.5 else -1.0
    return float(side * generator.uniform(*VEER))


def plume(
    seed: int, crossings: Sequence[Tuple[float, float, float]], at_panel_s: Mapping[int, float]
) -> Plume:
    """Draw a plume, on one of the robot's ways or before a panel.

    :param crossings: m, m and s, places on the robot's ways, and when it passes.
    :param at_panel_s: when it looks at each panel, by its number.
    """
    generator = _generator(seed, STEAM)
    number = int(generator.integers(len(crossings) + len(PANELS)))
    distance, aside = float(generator.uniform(*FROM_PANEL)), float(generator.uniform(-0.15, 0.15))
    if number < len(crossings):
        x, y, comes_s = crossings[number]
    else:
        panel = PANELS[number - len(crossings)]
        x, y, _ = before_panel(panel, distance, aside)
        comes_s = at_panel_s[panel.number]
    begins_s = max(0.0, comes_s - float(generator.uniform(*BEFORE_S)))
    ends_s = begins_s + float(generator.uniform(*VENTS_S))
    return Plume(x, y, float(generator.uniform(*RADIUS)), begins_s, ends_s)


def scattered(exact: np.ndarray, near: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Distances (n,) m along rays, some of which come back from a plume.

    :param exact: (n,) m, without it.
    :param near: (n,) m to its outline, inf where a ray misses it.
    """
    back = near + rng.uniform(0.0, DEEP, exact.shape)
    return np.where(rng.random(exact.shape) < RETURNS, np.minimum(exact, back), exact)


def _generator(seed: int, what: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32('extra_causes:{}'.format(what).encode())])
