"""The robot's base: wheels that follow commands, a floor that may be wet, and odometry."""

import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..rays import clearance
from ..site import ROBOT_RADIUS, WALLS, Pose, wrapped

MAX_SPEED = 0.9  # m/s
MAX_TURN = 1.8  # rad/s
ACCELERATION = 1.5  # m/s^2, of the wheels
TURN_ACCELERATION = 6.0  # rad/s^2
WET_LAG_S = 1.0  # in which wheels on a wet floor bring the robot to their speed
COMMAND_LIMIT_S = 0.6  # without a command the wheels stop


class WetPatch(NamedTuple):
    """A puddle: on it the robot slides, and one wheel grips better than the other."""

    x: float
    y: float
    radius: float  # m
    drift: float  # rad of heading that are gained per m of way, once the robot slides


class Twist(NamedTuple):
    """Forward speed and turn rate."""

    v: float = 0.0  # m/s
    w: float = 0.0  # rad/s


def _toward(value: float, wanted: float, most: float) -> float:
    return value + min(max(wanted - value, -most), most)


def _moved(pose: Pose, twist: Twist, dt_s: float) -> Pose:
    yaw = pose[2] + 0.5 * dt_s * twist.w
    return (
        pose[0] + dt_s * twist.v * math.cos(yaw),
        pose[1] + dt_s * twist.v * math.sin(yaw),
        wrapped(pose[2] + dt_s * twist.w),
    )


class WheeledBase:
    """The robot's base: where it truly is, and where its wheels say that it is."""

    def __init__(self, pose: Pose, wet: Optional[WetPatch] = None, veer: float = 0.0) -> None:
        """
        :param veer: rad for each m of way, that it turns and its wheels do not know of.
        """
        self.pose = pose  # in the map
        self.odometry: Pose = (0.0, 0.0, 0.0)  # from where it was started
        self.wheels = Twist()  # what the wheels turn
        self.twist = Twist()  # how it moves
        self.powered = True  # the motors
        self.bumped = False  # it stands against something
        self._wet = wet
        self._veer = veer
        self._wanted = Twist()
        self._silent_s = 0.0

    def command(self, v: float, w: float) -> None:
        """Set the speed (m/s) and the turn rate (rad/s). What is too fast is cut."""
        self._wanted = Twist(min(max(v, -MAX_SPEED), MAX_SPEED), min(max(w, -MAX_TURN), MAX_TURN))
        self._silent_s = 0.0

    def on_wet_floor(self) -> bool:
        """Whether it stands in the puddle."""
        wet = self._wet
        return (
            wet is not None and math.hypot(self.pose[0] - wet.x, self.pose[1] - wet.y) < wet.radius
        )

    def step(self, dt_s: float, people: Sequence[Tuple[float, float, float]] = ()) -> None:
        """Let time pass (s). `people`: x, y and radius in m. It cannot drive through them."""
        self._silent_s += dt_s
        running = self.powered and self._silent_s < COMMAND_LIMIT_S
        wanted = self._wanted if running else Twist()
        self.wheels = Twist(
            _toward(self.wheels.v, wanted.v, ACCELERATION * dt_s),
            _toward(self.wheels.w, wanted.w, TURN_ACCELERATION * dt_s),
        )
        self.odometry = _moved(self.odometry, self.wheels, dt_s)
        self.twist = self._on_the_floor(dt_s)
        moved = _moved(self.pose, self.twist, dt_s)
        self.bumped = not self._is_free(moved, people)
        if self.bumped:
            self.twist = Twist(0.0, self.twist.w)
            moved = _moved(self.pose, self.twist, dt_s)
        self.pose = moved

    def _on_the_floor(self, dt_s: float) -> Twist:
        """Return how the robot moves where its wheels turn as they do."""
        if self._wet is None or not self.on_wet_floor():
            return self.wheels._replace(w=self.wheels.w + self._veer * self.wheels.v)
        share = -math.expm1(-dt_s / WET_LAG_S)
        v = self.twist.v + share * (self.wheels.v - self.twist.v)
        # the turn that the drift gave it is no momentum
        turn = self.twist.w - self._wet.drift * self.twist.v
        turn += share * (self.wheels.w - turn)
        return Twist(v, turn + self._wet.drift * v)

    def _is_free(self, pose: Pose, people: Sequence[Tuple[float, float, float]]) -> bool:
        """Whether it may go there: nothing there, or away from what it stands against."""
        room, here = self._room(pose, people), self._room(self.pose, people)
        return room >= ROBOT_RADIUS or room > here + 1e-9 or self.twist.v == 0.0

    @staticmethod
    def _room(pose: Pose, people: Sequence[Tuple[float, float, float]]) -> float:
        return min(gaps(pose, people))


def gaps(pose: Pose, people: Sequence[Tuple[float, float, float]]) -> List[float]:
    """Return m from the robot's middle to the nearest wall, and to each of some people.

    :param people: x, y and radius in m.
    """
    to_people = [math.hypot(pose[0] - x, pose[1] - y) - radius for x, y, radius in people]
    return [clearance(pose[0], pose[1], WALLS), *to_people]


def noisy_ranges(exact: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Distances (m) as a laser scanner measures them, 1 cm off (sigma)."""
    return exact + rng.normal(0.0, 0.01, exact.shape)
