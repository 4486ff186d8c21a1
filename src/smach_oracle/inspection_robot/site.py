"""The hall as its plan has it: walls, and panels with a gauge each. The robot knows this plan."""

import math
from typing import NamedTuple, Tuple

import numpy as np

Pose = Tuple[float, float, float]  # x, y in m, yaw in rad, in the frame `map`


class GaugePanel(NamedTuple):
    """A panel with a gauge on a wall. Its middle is at the height of the camera."""

    number: int  # shown on it, 1 to 7
    x: float  # m, of its middle
    y: float
    facing: float  # rad: the direction in which it looks


# (n, 4) m: x and y of both ends
WALLS = np.array(
    [
        (0.0, 0.0, 10.0, 0.0),
        (10.0, 0.0, 10.0, 7.0),
        (10.0, 7.0, 0.0, 7.0),
        (0.0, 7.0, 0.0, 0.0),
        (3.5, 0.0, 3.5, 4.4),
        (6.5, 2.6, 6.5, 7.0),
        (8.4, 0.0, 8.4, 0.8),
        (0.0, 3.0, 0.7, 3.0),
    ]
)
SIZE = (10.0, 7.0)  # m
START: Pose = (1.2, 1.2, math.pi / 2)
PANELS = (
    GaugePanel(1, 1.8, 7.0, -math.pi / 2),
    GaugePanel(2, 5.0, 0.0, math.pi / 2),
    GaugePanel(3, 10.0, 4.8, math.pi),
)

ROBOT_RADIUS = 0.25  # m
CAMERA_HEIGHT = 1.0  # m
PANEL_SIDE = 0.6  # m. Panels are square
# of a panel's side: its dark frame, the middle and the radius of the dial, the ends of the needle
FRAME = 0.09
DIAL = (0.5, 0.44, 0.29)
NEEDLE = (0.05, 0.24)
# of a panel's side: the cells that show its number as binary digits, least first: x, y, size
CELLS = ((0.32, 0.82, 0.08), (0.5, 0.82, 0.08), (0.68, 0.82, 0.08))
GAUGE_RANGE = 10.0  # bar
ZERO_ANGLE = math.radians(225)  # of the needle at 0 bar: counter-clockwise, 0 to the right
SWEEP = math.radians(270)  # clockwise, from 0 bar to GAUGE_RANGE


def wrapped(angle: float) -> float:
    """The same angle from -pi to pi (rad)."""
    return math.remainder(angle, 2 * math.pi)


def before_panel(panel: GaugePanel, distance: float, aside: float = 0.0) -> Pose:
    """The pose that looks straight at a panel's wall.

    :param distance: m from the panel.
    :param aside: m to the left, as the robot sees it.
    """
    yaw = wrapped(panel.facing + math.pi)
    return (
        panel.x + distance * math.cos(panel.facing) - aside * math.sin(yaw),
        panel.y + distance * math.sin(panel.facing) + aside * math.cos(yaw),
        yaw,
    )
