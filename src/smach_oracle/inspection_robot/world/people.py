"""People who walk through the hall, and stand where their errand takes them."""

import math
from typing import NamedTuple, Sequence, Tuple

BODY_RADIUS = 0.22  # m
BODY_HEIGHT = 1.75  # m
WALKING_SPEED = 1.1  # m/s
KEEPS_AWAY = 0.6  # m between the middles of a person who walks, and of the robot
WALKS_AROUND = 0.55  # m, the same, of one who has waited for it to pass and now walks around it
WAITS_S = 2.0


class Errand(NamedTuple):
    """The places to which a person goes, one after the other, once they set out."""

    begins_s: float  # of the trial
    places: Tuple[Tuple[float, float], ...]  # m. The first is where they wait before it
    stands_s: Tuple[float, ...]  # how long they stand at each place
    cause: str = ''  # kind of the cause that they are at the second place. '' means none


class Walker:
    """A person with an errand, who lets the robot pass, for a moment, and then goes on."""

    def __init__(self, errand: Errand) -> None:
        self.x, self.y = errand.places[0]
        self._errand = errand
        self._next = 0
        self._stands_s = errand.begins_s + errand.stands_s[0]
        self._waited_s = 0.0  # for the robot

    @property
    def circle(self) -> Tuple[float, float, float]:
        """x, y and radius (m)."""
        return self.x, self.y, BODY_RADIUS

    @property
    def makes(self) -> str:
        """Kind of the cause that they are where they stand now. '' means none."""
        there = self._errand.places[1:2] == ((self.x, self.y),)
        return self._errand.cause if there and self._next == 1 else ''

    def step(self, dt_s: float, robot: Sequence[float]) -> None:
        """Let time pass (s). `robot`: where it is, x and y in m."""
        if self._stands_s > 0:
            self._stands_s -= dt_s
            return
        if self._next + 1 >= len(self._errand.places):
            return
        x, y = self._errand.places[self._next + 1]
        left = math.hypot(x - self.x, y - self.y)
        way = WALKING_SPEED * dt_s
        if left <= way:
            self.x, self.y, self._next = x, y, self._next + 1
            self._stands_s = self._errand.stands_s[self._next]
            return
        ahead = (self.x + way * (x - self.x) / left, self.y + way * (y - self.y) / left)
        if self._is_free(ahead, robot):
            self.x, self.y = ahead
            self._waited_s = max(0.0, self._waited_s - dt_s)
        elif self._waited_s < WAITS_S:
            self._waited_s += dt_s
        else:
            self._walk_around(way, robot, (x, y))

    def _is_free(self, ahead: Tuple[float, float], robot: Sequence[float]) -> bool:
        """Whether a step keeps away from the robot, or leads away from it."""
        gap = math.hypot(ahead[0] - robot[0], ahead[1] - robot[1])
        return gap >= KEEPS_AWAY or gap > math.hypot(self.x - robot[0], self.y - robot[1])

    def _walk_around(self, way: float, robot: Sequence[float], target: Tuple[float, float]) -> None:
        """One step along a circle around the robot, on the side on which the target is."""
        angle = math.atan2(self.y - robot[1], self.x - robot[0])
        wanted = math.atan2(target[1] - robot[1], target[0] - robot[0])
        radius = max(WALKS_AROUND, math.hypot(self.x - robot[0], self.y - robot[1]))
        side = math.copysign(way / radius, math.remainder(wanted - angle, 2 * math.pi))
        self.x = robot[0] + radius * math.cos(angle + side)
        self.y = robot[1] + radius * math.sin(angle + side)
