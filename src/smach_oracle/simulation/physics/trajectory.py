"""Joint trajectories as a PR2's controllers follow them, and the protocol of all motions.

    result = run(world, Trajectory(joints, positions, times))

A motion is ticked before each control period, and returns None until it has ended. Several may be
ticked side by side.
"""

import math
from typing import List, Mapping, NamedTuple, Optional, Protocol, Sequence, Tuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from smach_oracle.pr2.robot import GripperState

from .pr2_body import PERIOD, arm_of
from .world import World

PATH_TOLERANCE = 0.2  # rad or m that a joint may be behind on the way
GOAL_TOLERANCE = 0.01  # rad or m at the end
BLEND_S = 0.1  # s in which the speed changes at a corner of a trajectory without velocities
# least and most time after the end in which joints may arrive and come to rest
ARRIVAL_S = (0.1, 1.0)
SPEED_MARGIN = 1.1  # times the URDF's limit that a trajectory may ask for


class MotionResult(NamedTuple):
    """The result of a motion."""

    ok: bool
    text: str = ''  # why not
    gripper: Optional[GripperState] = None
    missed: str = ''  # a trajectory's tolerance that was missed: 'path' or 'goal'


class Tolerances(NamedTuple):
    """The tolerances of joints (rad or m, inf: any), where they are not the usual ones."""

    path: Mapping[str, float] = {}
    goal: Mapping[str, float] = {}
    late_s: float = 0.0  # how much more than usual it may take to arrive


USUAL = Tolerances()


class Motion(Protocol):
    """Something a controller does."""

    def tick(self, world: World) -> Optional[MotionResult]:
        """Send the joints on for the coming period. The result where it has ended."""

    def events(self) -> Sequence[str]:
        """Return what has happened when it has ended, for the world's disturbances."""

    def stop(self, world: World) -> None:
        """Hold everything that it moved where it is."""


def run(world: World, motion: Motion) -> MotionResult:
    """Step the world until a motion has ended, and with it what its end set off."""
    result = motion.tick(world)
    while result is None:
        world.step()
        result = motion.tick(world)
    world.happened(*motion.events())
    while world.disturbed:
        world.step()
    return result


class Trajectory:
    """Takes joints through points in time, as a PR2's controllers do.

    Between two points it goes straight, or cubic where velocities are given.
    """

    def __init__(
        self,
        joints: Sequence[str],
        positions: np.ndarray,
        times: np.ndarray,
        velocities: Optional[np.ndarray] = None,
        check_speed: bool = True,
        tolerances: Tolerances = USUAL,
    ) -> None:
        """Take a command.

        :param positions: (n, len(joints)), rad or m. Continuous joints are taken the short way to
            the first point.
        :param times: (n,) s from the start, increasing. The first may be 0.
        :param velocities: (n, len(joints)), rad/s or m/s.
        :raises ValueError: for shapes that do not fit, values that are not finite, times that do
            not increase.
        """
        self._joints = list(joints)
        self._tolerances = tolerances
        self._positions = np.array(positions, float)
        self._times = np.array(times, float)
        self._velocities = None if velocities is None else np.array(velocities, float)
        self._check_speed = check_speed
        self._begun = -1
        self._arriving_since = 0
        _check_points(self._joints, self._positions, self._times, self._velocities)

    @property
    def joints(self) -> List[str]:
        """Return the joints that it moves."""
        return self._joints

    def refusal(self, world: World) -> str:
        """Return why this robot cannot do it, from where it is now, or ''."""
        robot = world.robot
        for column, name in enumerate(self._joints):
            if name not in robot.encoders or name.endswith('finger_joint'):
                return 'no controller for joint {!r}'.format(name)
            for end in (self._positions[:, column].min(), self._positions[:, column].max()):
                if robot.refusal(name, end):
                    return robot.refusal(name, end)
        return self._too_fast(world) if self._check_speed else ''

    def _too_fast(self, world: World) -> str:
        start, positions, times = self._from_here(world)
        steps = np.diff(np.vstack([start, positions]), axis=0)
        spans = np.diff(np.concatenate([[0.0], times]))
        for column, name in enumerate(self._joints):
            limit = SPEED_MARGIN * world.robot.speeds[name]
            for step, span in zip(steps[:, column], spans):
                if abs(step) > limit * span + 0.01:
                    return '{} would go {:.3g} in {:.3g} s; its limit is {:.3g}/s'.format(
                        name, abs(step), span, world.robot.speeds[name]
                    )
            if self._velocities is not None and np.abs(self._velocities[:, column]).max() > limit:
                return '{} would pass a point at {:.3g}/s; its limit is {:.3g}/s'.format(
                    name, np.abs(self._velocities[:, column]).max(), world.robot.speeds[name]
                )
        return ''

    def _from_here(self, world: World) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Start (n,), and the points still to come, with continuous joints taken the short way."""
        robot = world.robot
        start = np.array([_held(world, name) for name in self._joints])
        positions = self._positions.copy()
        for column, name in enumerate(self._joints):
            if math.isinf(robot.limits[name][1]):
                turns = np.round((positions[0, column] - start[column]) / (2 * np.pi))
                positions[:, column] -= 2 * np.pi * turns
        return start, positions, self._times

    def tick(self, world: World) -> Optional[MotionResult]:
        """See Motion."""
        if self._begun < 0:
            wrong = self.refusal(world)
            if wrong:
                return MotionResult(False, wrong)
            start, positions, times = self._from_here(world)
            self._begin(world, start, positions, times)
        done = world.periods - self._begun
        behind = self._behind(world, done)
        if behind:
            self.stop(world)
            return MotionResult(False, behind, missed='path')
        if done >= len(self._setpoints) - 1:
            return self._arrive(world)
        for name, before, after in zip(
            self._joints, self._setpoints[done], self._setpoints[done + 1]
        ):
            world.robot.set_target(name, after, (after - before) / PERIOD, None)
        return None

    def _begin(
        self, world: World, start: np.ndarray, positions: np.ndarray, times: np.ndarray
    ) -> None:
        self._begun = world.periods
        drop = int(times[0] <= 0.0 and len(times) > 1)
        knots = np.concatenate([[0.0], np.maximum(times[drop:], PERIOD)])
        points = np.vstack([start, positions[drop:]])
        moments = PERIOD * np.arange(math.ceil(knots[-1] / PERIOD - 1e-9) + 1)
        if self._velocities is None:
            self._setpoints = _blended(
                np.column_stack([np.interp(moments, knots, column) for column in points.T])
            )
        else:
            slopes = np.vstack([np.zeros(len(start)), self._velocities[drop:]])
            self._setpoints = CubicHermiteSpline(knots, points, slopes)(
                np.minimum(moments, knots[-1])
            )

    def _behind(self, world: World, done: int) -> str:
        wanted = self._setpoints[min(done, len(self._setpoints) - 1)]
        errors = np.abs(world.robot.positions(self._joints) - wanted)
        for name, error in zip(self._joints, errors.tolist()):
            if error > self._tolerances.path.get(name, PATH_TOLERANCE):
                return '{} is {:.2f} off its path after {:.1f} s: something is in its way'.format(
                    name, error, done * PERIOD
                )
        return ''

    def _arrive(self, world: World) -> Optional[MotionResult]:
        goal = self._setpoints[-1]
        if not self._arriving_since:
            self._arriving_since = world.periods
            for name, position in zip(self._joints, goal):
                world.robot.set_target(name, position, 0.0, None)
        waited = (world.periods - self._arriving_since) * PERIOD
        errors = np.abs(world.robot.positions(self._joints) - goal).tolist()
        shares = [
            error / self._tolerances.goal.get(name, GOAL_TOLERANCE)
            for name, error in zip(self._joints, errors)
        ]
        if waited >= ARRIVAL_S[0] and max(shares) < 1.0:
            return MotionResult(True)
        if waited < ARRIVAL_S[1] + self._tolerances.late_s:
            return None
        worst = int(np.argmax(shares))
        self.stop(world)
        return MotionResult(
            False,
            '{} ended {:.3f} from its goal'.format(self._joints[worst], errors[worst]),
            missed='goal',
        )

    def events(self) -> Sequence[str]:
        """See Motion."""
        arms = sorted({arm_of(name) for name in self._joints} - {''})
        return ['follow'] + ['follow_' + arm for arm in arms] if arms else []

    def stop(self, world: World) -> None:
        """See Motion."""
        for name in self._joints:
            world.robot.set_target(name, world.robot.position(name), 0.0, None)


def _blended(way: np.ndarray) -> np.ndarray:
    """A path (periods, joints) whose corners take BLEND_S, and which ends that much later."""
    width = max(1, round(BLEND_S / PERIOD))
    padded = np.vstack(
        [np.repeat(way[:1], width - 1, axis=0), way, np.repeat(way[-1:], width, axis=0)]
    )
    total = np.cumsum(np.vstack([np.zeros(way.shape[1]), padded]), axis=0)
    return (total[width:] - total[:-width]) / width


def _held(world: World, name: str) -> float:
    """Return where a joint was sent, if it is about there, else where it is."""
    target, position = world.robot.target(name), world.robot.position(name)
    return target if abs(target - position) < 0.02 else position


def _check_points(
    joints: List[str], positions: np.ndarray, times: np.ndarray, velocities: Optional[np.ndarray]
) -> None:
    count = len(joints)
    if not count or len(set(joints)) != count:
        raise ValueError(
            'trajectory: joints are {}; allowed: at least one, none twice'.format(joints)
        )
    if (
        positions.ndim != 2
        or positions.shape[1] != count
        or not len(positions)
        or times.shape != positions.shape[:1]
    ):
        raise ValueError(
            'trajectory: positions {} and times {} do not fit to {} joints'.format(
                positions.shape, times.shape, count
            )
        )
    if velocities is not None and velocities.shape != positions.shape:
        raise ValueError(
            'trajectory: velocities {} do not fit to positions {}'.format(
                velocities.shape, positions.shape
            )
        )
    if not (
        np.isfinite(positions).all()
        and np.isfinite(times).all()
        and (velocities is None or np.isfinite(velocities).all())
    ):
        raise ValueError('trajectory: a position, velocity or time is not finite')
    if times[0] < 0 or (np.diff(times) <= 0).any():
        raise ValueError('trajectory: times {} are not increasing from 0'.format(times.tolist()))
