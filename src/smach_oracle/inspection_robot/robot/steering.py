"""From a pose, the legs of a route and a scan to the next command, pure."""

import math
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from ..site import ROBOT_RADIUS, Pose, wrapped

SPEED = 0.8  # m/s
TURN = 1.5  # rad/s
TURN_FIRST = 0.35  # rad off its course: the robot turns before it drives
AT_POINT = 0.15  # m from the end of a leg
AT_GOAL = 0.06  # m from the goal
FACING = 0.03  # rad from the goal's heading
LOOKS_AHEAD = 0.75  # m from its middle
HALF_WIDTH = ROBOT_RADIUS + 0.08  # m of the strip that must be free
SLOWS_BY = 1.2  # m/s per m that are left


class WheelCommand(NamedTuple):
    """A command to the wheels."""

    v: float = 0.0  # m/s
    w: float = 0.0  # rad/s
    blocked: bool = False  # it would drive, and something is in the way
    arrived: bool = False


class Steering:
    """Follows the legs one after the other, then turns to the goal's heading."""

    def __init__(self, legs: Sequence[Tuple[float, float]], yaw: float) -> None:
        self._legs: List[Tuple[float, float]] = list(legs)
        self._yaw = yaw
        self._turning = False  # it has come to the goal: from here on it only turns

    def next(self, pose: Pose, ranges: np.ndarray, angles: np.ndarray) -> WheelCommand:
        """The command at a pose (in the map), with a scan: (n,) m along (n,) rad."""
        while len(self._legs) > 1 and _distance(pose, self._legs[0]) < AT_POINT:
            del self._legs[0]
        left = _distance(pose, self._legs[0])
        if self._turning or (len(self._legs) == 1 and left < AT_GOAL):
            self._turning = True
            off = wrapped(self._yaw - pose[2])
            return WheelCommand(arrived=True) if abs(off) < FACING else WheelCommand(w=_turn(off))
        aim = self._legs[0]
        off = wrapped(math.atan2(aim[1] - pose[1], aim[0] - pose[0]) - pose[2])
        if abs(off) > TURN_FIRST:
            return WheelCommand(w=_turn(off))
        if is_blocked(ranges, angles, min(LOOKS_AHEAD, left + ROBOT_RADIUS)):
            return WheelCommand(blocked=True)
        rest = left if len(self._legs) == 1 else left + 0.5
        return WheelCommand(v=min(SPEED, max(0.08, SLOWS_BY * rest)), w=_turn(off))


def is_blocked(ranges: np.ndarray, angles: np.ndarray, ahead: float) -> bool:
    """Whether the scan has a point on the strip of so many metres before the robot."""
    x, y = ranges * np.cos(angles), ranges * np.sin(angles)
    return bool(((x > 0) & (x < ahead) & (np.abs(y) < HALF_WIDTH)).any())


def _turn(off: float) -> float:
    return min(max(2.5 * off, -TURN), TURN)


def _distance(pose: Sequence[float], point: Sequence[float]) -> float:
    return math.hypot(point[0] - pose[0], point[1] - pose[1])
