"""Drives a hand by velocities, as a person at a joystick does: towards a place, watching it."""

from typing import NamedTuple, Protocol, Tuple

import numpy as np

from smach_oracle.geometry.transforms import inverse, rotation_vector

_FINE = 0.35  # share of the way to the goal that is driven in one period near its end, at most
_PATIENCE = 25  # periods without getting nearer
_EASE_S = 30.0  # within which an arm that sways on comes to its ease, or is taken as it is
_AT_EASE = 8  # periods in which the hand hardly moves any more


class GripResult(NamedTuple):
    """The result of a motion of the gripper."""

    gap: float  # m between the tips
    stalled: bool


class DrivenHand(Protocol):
    """A hand that obeys velocities, one control period at a time."""

    arm: str
    period: float  # s

    def tool(self) -> np.ndarray:
        """4x4, base_footprint from the tool, now."""

    def move(self, twist: np.ndarray, turn_freely: bool = False) -> str:
        """One period at a twist (6,) (m/s, rad/s, axes of base_footprint).

        Return what limited it, or ''.

        `turn_freely`: only its linear part counts.
        """

    def grip(self, gap: float, effort: float) -> GripResult:
        """Move the gripper to `gap` m between its tips, with at most `effort` N, until it rests."""


class StuckError(Exception):
    """The hand does not get there. The text says how far it got and what stopped it."""


class HandDriver:
    """Drives one hand."""

    def __init__(self, hand: DrivenHand, speed: float = 0.22, turn: float = 0.9) -> None:
        """`speed`: m/s, `turn`: rad/s, of free motions."""
        self.hand = hand
        self._speed = speed
        self._turn = turn

    def go(
        self, goal: np.ndarray, share: float = 1.0, near: Tuple[float, float] = (0.01, 0.05)
    ) -> None:
        """Drive the tool straight to a pose (4x4, base_footprint from tool).

        :param share: of the speed of free motions.
        :param near: m and rad from the goal that will do.
        :raises StuckError: where it does not come nearer any more.
        """
        best, since, limit = np.inf, 0, ''
        while True:
            way, turn = error(self.hand.tool(), goal)
            distance, angle = float(np.linalg.norm(way)), float(np.linalg.norm(turn))
            if distance < near[0] and angle < near[1]:
                return
            left = distance + 0.2 * angle
            best, since = (left, 0) if left < best - 5e-4 else (best, since + 1)
            if since > _PATIENCE:
                raise StuckError(
                    'the hand stays {:.0f} cm and {:.0f} degrees away{}'.format(
                        100 * distance, np.degrees(angle), ': ' + limit if limit else ''
                    )
                )
            limit = (
                self.hand.move(np.concatenate([way, turn]) / self._time_for(distance, angle, share))
                or limit
            )

    def come_to(self, point: np.ndarray, near: float = 0.03) -> None:
        """Drive the tool to a point (3,) m, base_footprint, and let the arm turn to its posture.

        :raises StuckError: where it does not come as near as `near` m.
        """
        before = self.hand.tool()
        still, limit = 0, ''
        for _ in range(int(_EASE_S / self.hand.period)):
            if still >= _AT_EASE:
                break
            way = point - before[:3, 3]
            velocity = way / self._time_for(float(np.linalg.norm(way)), 0.0, 1.0)
            limit = (
                self.hand.move(np.concatenate([velocity, np.zeros(3)]), turn_freely=True) or limit
            )
            now = self.hand.tool()
            moved, turned = (float(np.linalg.norm(part)) for part in error(before, now))
            still = still + 1 if moved < 5e-4 and turned < 4e-3 else 0
            before = now
        distance = float(np.linalg.norm(point - before[:3, 3]))
        if distance > near:
            raise StuckError(
                'the hand stays {:.0f} cm away{}'.format(
                    100 * distance, ': ' + limit if limit else ''
                )
            )

    def shift(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, share: float = 1.0) -> None:
        """Drive by so many m along the axes of base_footprint.

        :raises StuckError: where it does not get there.
        """
        goal = self.hand.tool().copy()
        goal[:3, 3] += (x, y, z)
        self.go(goal, share)

    def back(self, distance: float, share: float = 0.5) -> None:
        """Draw the hand back by so many m, along its own axis.

        :raises StuckError: where it does not get there.
        """
        tool = self.hand.tool()
        x, y, z = -distance * tool[:3, 0]
        self.shift(x, y, z, share=share)

    def open(self, gap: float = 0.085) -> None:
        """Open the gripper to `gap` m."""
        self.hand.grip(gap, 40.0)

    def close(self, effort: float = 100.0) -> GripResult:
        """Close it on whatever there is, with at most `effort` N."""
        return self.hand.grip(0.0, effort)

    def rest(self, periods: int) -> None:
        """Wait for so many control periods."""
        for _ in range(periods):
            self.hand.move(np.zeros(6))

    def _time_for(self, distance: float, angle: float, share: float) -> float:
        return max(
            distance / (self._speed * share), angle / (self._turn * share), self.hand.period / _FINE
        )


def error(tool: np.ndarray, goal: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """The way from one pose (4x4) to another: m (3,) and rad (3,), along the axes of their base."""
    turned = goal @ inverse(tool)
    return goal[:3, 3] - tool[:3, 3], rotation_vector(turned)
