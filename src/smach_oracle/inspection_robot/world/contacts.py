"""Contacts of the robot: the walls and people that it drives against."""

from typing import List, Sequence, Set

from ..rays import Circle
from ..site import ROBOT_RADIUS
from .base import WheeledBase, gaps

AWAY = 0.05  # m of room after which it stands against a thing no more
WALL = 'wall'


class Contacts:
    """The contacts of one trial. People keep away from the robot, so the robot makes them all."""

    def __init__(self) -> None:
        self.things: List[str] = []  # once for each contact: `wall`, `person 1`
        self._against: Set[str] = set()  # it has not come away from them

    def look(self, base: WheeledBase, people: Sequence[Circle]) -> None:
        """Take in where the base is after a step. `people` are where they were in that step."""
        names = [WALL] + ['person {}'.format(number + 1) for number in range(len(people))]
        room = dict(zip(names, gaps(base.pose, people)))
        self._against = {name for name in self._against if room[name] < ROBOT_RADIUS + AWAY}
        if base.bumped:
            nearest = min(names, key=lambda name: room[name])
            if nearest not in self._against:
                self._against.add(nearest)
                self.things.append(nearest)
