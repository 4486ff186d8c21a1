"""A way through the hall, from its plan: straight legs that keep clear of the walls."""

import heapq
import math
from typing import Dict, List, Sequence, Tuple

import numpy as np

from ..rays import clearance
from ..site import ROBOT_RADIUS, SIZE, WALLS

CELL = 0.2  # m
MARGIN = ROBOT_RADIUS + 0.12  # m from the middle of the robot to the walls
Cell = Tuple[int, int]
Point = Tuple[float, float]


class RouteError(Exception):
    """There is no way. The text says from where to where."""


class RoutePlanner:
    """Plans on a grid of the hall. What stands in the hall and is not on the plan it ignores."""

    def __init__(self) -> None:
        shape = (int(SIZE[0] / CELL), int(SIZE[1] / CELL))
        self._room = np.array(
            [[clearance(*_middle((i, j)), WALLS) for j in range(shape[1])] for i in range(shape[0])]
        )

    def legs(self, start: Sequence[float], goal: Sequence[float]) -> List[Point]:
        """The ends of straight legs (m), the goal last.

        :raises RouteError: where the goal is too near to a wall, or cannot be reached.
        """
        target = (float(goal[0]), float(goal[1]))
        inside = all(0 < value < most for value, most in zip(target, SIZE))
        if not inside or clearance(*target, WALLS) < ROBOT_RADIUS:
            raise RouteError('the goal at {:.2f}, {:.2f} is in a wall'.format(*target))
        cells = self._cells(self._free_cell(start), self._free_cell(target))
        points = [(float(start[0]), float(start[1]))]
        points += [_middle(cell) for cell in cells[1:-1]] + [target]
        return self._straightened(points)

    def _free_cell(self, point: Sequence[float]) -> Cell:
        """The nearest cell with room for the robot."""
        away = np.array(
            [
                [
                    math.hypot(x - point[0], y - point[1])
                    for x, y in (_middle((i, j)) for j in range(self._room.shape[1]))
                ]
                for i in range(self._room.shape[0])
            ]
        )
        away[self._room < MARGIN] = np.inf
        i, j = np.unravel_index(int(np.argmin(away)), away.shape)
        return int(i), int(j)

    def _cells(self, start: Cell, goal: Cell) -> List[Cell]:
        """The shortest way, cell by cell."""
        waiting: List[Tuple[float, Cell]] = [(0.0, start)]
        came_from: Dict[Cell, Cell] = {start: start}
        way = {start: 0.0}
        while waiting:
            _, cell = heapq.heappop(waiting)
            if cell == goal:
                return _traced(came_from, goal)
            for step in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                reached = (cell[0] + step[0], cell[1] + step[1])
                if not self._is_free(reached):
                    continue
                longer = way[cell] + math.hypot(*step)
                if longer < way.get(reached, math.inf):
                    way[reached], came_from[reached] = longer, cell
                    left = math.hypot(goal[0] - reached[0], goal[1] - reached[1])
                    heapq.heappush(waiting, (longer + left, reached))
        raise RouteError(
            'there is no way from {:.1f}, {:.1f} to {:.1f}, {:.1f}'.format(
                *_middle(start), *_middle(goal)
            )
        )

    def _is_free(self, cell: Cell) -> bool:
        return (
            0 <= cell[0] < self._room.shape[0]
            and 0 <= cell[1] < self._room.shape[1]
            and bool(self._room[cell] >= MARGIN)
        )

    @staticmethod
    def _straightened(points: List[Point]) -> List[Point]:
        """Fewer legs: each as long as the walls let it be. Without the start."""
        legs, here = [], 0
        while here < len(points) - 1:
            there = next(
                (
                    end
                    for end in range(len(points) - 1, here + 1, -1)
                    if _is_clear(points[here], points[end])
                ),
                here + 1,
            )
            legs.append(points[there])
            here = there
        return legs


def _middle(cell: Cell) -> Point:
    return (cell[0] + 0.5) * CELL, (cell[1] + 0.5) * CELL


def _traced(came_from: Dict[Cell, Cell], goal: Cell) -> List[Cell]:
    cells = [goal]
    while came_from[cells[-1]] != cells[-1]:
        cells.append(came_from[cells[-1]])
    return cells[::-1]


def _is_clear(start: Point, end: Point) -> bool:
    """Whether the robot fits along a straight line."""
    steps = max(2, int(math.hypot(end[0] - start[0], end[1] - start[1]) / 0.1))
    return all(
        clearance(
            start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]), WALLS
        )
        >= MARGIN
        for share in np.linspace(0.0, 1.0, steps)
    )
