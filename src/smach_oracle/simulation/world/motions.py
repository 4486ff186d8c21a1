"""What the PR2's controllers do, one control period at a time: trajectories, grippers, torso, head, base.

    result = run(world, Trajectory(joints, positions, times))

A motion is ticked before each control period and says None until it has ended. Several may be ticked side by side.
"""
import math
from functools import lru_cache
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from typing_extensions import Protocol

from ...geometry.chain import Chain
from ...geometry.transforms import apply, from_rpy, inverse, yaw_of
from ..robot.interface import ARMS, BASE_FRAME, CAMERA_FRAME, GRIPPER_OPEN, GripperState
from ..robot.pr2_model import BASE_JOINTS, pr2_urdf
from .physics import World
from .pr2_body import PERIOD, arm_of

PATH_TOLERANCE = 0.2  # rad or m that a joint may be behind on the way
GOAL_TOLERANCE = 0.01  # rad or m at the end
SETTLE_S = (0.1, 1.0)  # least and most time after the end in which joints may arrive and come to rest
CLOSING_SPEED = 0.08  # m/s of the gap
STALL_S = 0.25
TORSO_SPEED = 0.013  # m/s, a PR2's
HEAD_SPEED = 1.0  # rad/s, mean of a turn
BASE_SPEED, BASE_TURN = 0.25, 0.4  # m/s, rad/s, means of a drive
SPEED_MARGIN = 1.1  # times the URDF's limit that a trajectory may ask for


class Result(NamedTuple):
    """How a motion ended."""

    ok: bool
    text: str = ''  # why not
    gripper: Optional[GripperState] = None


class Motion(Protocol):
    """Something a controller does."""

    def tick(self, world: World) -> Optional[Result]:
        """Send the joints on for the coming period, or say how it has ended."""

    def events(self) -> Sequence[str]:
        """What has happened when it has ended, for the world's disturbances."""

    def stop(self, world: World) -> None:
        """Hold everything that it moved where it is."""


def run(world: World, motion: Motion) -> Result:
    """Step the world until a motion has ended, and with it what its end set off."""
    result = motion.tick(world)
    while result is None:
        world.step()
        result = motion.tick(world)
    world.happened(*motion.events())
    while world.unrest:
        world.step()
    return result


class Trajectory:
    """Joints through points in time: straight between two, or cubic where velocities are given, as a PR2's do."""

    def __init__(self, joints: Sequence[str], positions: np.ndarray, times: np.ndarray,
                 velocities: Optional[np.ndarray] = None, check_speed: bool = True) -> None:
        """
        :param positions: (n, len(joints)), rad or m; continuous joints are taken the short way to the first point.
        :param times: (n,) s from the start, increasing; the first may be 0.
        :param velocities: (n, len(joints)).
        :raises ValueError: for shapes that do not fit, values that are not finite, times that do not increase.
        """
        self._joints = list(joints)
        self._positions = np.array(positions, float)
        self._times = np.array(times, float)
        self._velocities = None if velocities is None else np.array(velocities, float)
        self._check_speed = check_speed
        self._begun = -1
        self._settled = 0
        _check_points(self._joints, self._positions, self._times, self._velocities)

    def refusal(self, world: World) -> str:
        """Why this robot cannot do it, from where it is now; or ''."""
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
                        name, abs(step), span, world.robot.speeds[name])
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

    def tick(self, world: World) -> Optional[Result]:
        if self._begun < 0:
            wrong = self.refusal(world)
            if wrong:
                return Result(False, wrong)
            start, positions, times = self._from_here(world)
            self._begin(world, start, positions, times)
        done = (world.periods - self._begun) * PERIOD
        behind = self._behind(world, done)
        if behind:
            self.stop(world)
            return Result(False, behind)
        if done >= self._knots[-1] - 1e-9:
            return self._settle(world)
        here, there = self._at(done), self._at(done + PERIOD)
        for name, before, after in zip(self._joints, here, there):
            world.robot.set_target(name, after, (after - before) / PERIOD, None)
        return None

    def _begin(self, world: World, start: np.ndarray, positions: np.ndarray, times: np.ndarray) -> None:
        self._begun = world.periods
        drop = int(times[0] <= 0.0 and len(times) > 1)
        self._knots = np.concatenate([[0.0], np.maximum(times[drop:], PERIOD)])
        self._points = np.vstack([start, positions[drop:]])
        self._slopes = None
        if self._velocities is not None:
            self._slopes = np.vstack([np.zeros(len(start)), self._velocities[drop:]])

    def _at(self, time: float) -> np.ndarray:
        if time >= self._knots[-1]:
            return self._points[-1]
        segment = int(np.searchsorted(self._knots, time, side='right')) - 1
        span = self._knots[segment + 1] - self._knots[segment]
        share = (time - self._knots[segment]) / span
        first, last = self._points[segment], self._points[segment + 1]
        if self._slopes is None:
            return first + share * (last - first)
        begin, end = span * self._slopes[segment], span * self._slopes[segment + 1]
        rest = 1.0 - share
        return (first * rest * rest * (1 + 2 * share) + last * share * share * (3 - 2 * share)
                + share * rest * (begin * rest - end * share))

    def _behind(self, world: World, done: float) -> str:
        wanted = self._at(done)
        for name, position in zip(self._joints, wanted):
            error = world.robot.position(name) - position
            if abs(error) > PATH_TOLERANCE:
                return '{} is {:.2f} off its path at {:.1f} s: something is in its way'.format(name, abs(error), done)
        return ''

    def _settle(self, world: World) -> Optional[Result]:
        if not self._settled:
            self._settled = world.periods
            for name, position in zip(self._joints, self._points[-1]):
                world.robot.set_target(name, position, 0.0, None)
        waited = (world.periods - self._settled) * PERIOD
        errors = [abs(world.robot.position(name) - end) for name, end in zip(self._joints, self._points[-1])]
        if waited >= SETTLE_S[0] and max(errors) < GOAL_TOLERANCE:
            return Result(True)
        if waited < SETTLE_S[1]:
            return None
        worst = int(np.argmax(errors))
        self.stop(world)
        return Result(False, '{} ended {:.3f} from its goal'.format(self._joints[worst], errors[worst]))

    def events(self) -> Sequence[str]:
        arms = sorted({arm_of(name) for name in self._joints} - {''})
        return ['follow'] + ['follow_' + arm for arm in arms] if arms else []

    def stop(self, world: World) -> None:
        for name in self._joints:
            world.robot.set_target(name, world.robot.position(name), 0.0, None)


class Gripper:
    """The two fingers of a hand to a gap; ends when they are there, or stall."""

    def __init__(self, arm: str, position: float, max_effort: float = 50.0) -> None:
        """Raises ValueError for an unknown arm, a gap (m) outside 0 to 0.09, an effort (N) outside 0 to 200."""
        if arm not in ARMS:
            raise ValueError('unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))
        if not 0.0 <= position <= GRIPPER_OPEN + 1e-3 or not 0.0 < max_effort <= 200.0:
            raise ValueError('{} gripper: {} m with {} N; allowed: 0 to {} m, above 0 to 200 N'.format(
                arm, position, max_effort, GRIPPER_OPEN))
        self._arm, self._goal, self._effort = arm, min(position, GRIPPER_OPEN), max_effort
        self._gaps: List[float] = []
        self._sent = self._start = 0.0

    def tick(self, world: World) -> Optional[Result]:
        gap = world.gap(self._arm)
        if not self._gaps:
            self._sent = self._start = gap
        self._gaps.append(gap)
        step = CLOSING_SPEED * PERIOD
        self._sent += min(max(self._goal - self._sent, -step), step)
        world.set_gripper(self._arm, min(max(self._sent, 0.0), GRIPPER_OPEN), self._effort)
        window = round(STALL_S / PERIOD)
        if len(self._gaps) <= window or max(self._gaps[-window:]) - min(self._gaps[-window:]) > 3e-4:
            return None
        reached = abs(gap - self._goal) < 2e-3
        if not reached and abs(self._sent - self._goal) > 1e-6:
            return None
        effort = world.robot.finger_force(self._arm)
        return Result(True, '', GripperState(gap, effort, not reached, reached))

    def events(self) -> Sequence[str]:
        return ['{}_{}'.format('open' if self._goal > self._start else 'close', self._arm)]

    def stop(self, world: World) -> None:
        world.set_gripper(self._arm, min(max(world.gap(self._arm), 0.0), GRIPPER_OPEN), self._effort)


class Torso(Trajectory):
    """The spindle to a height, at a PR2's pace."""

    def __init__(self, world: World, height: float) -> None:
        """Raises ValueError for a height (m) that is no number."""
        if not math.isfinite(height):
            raise ValueError('torso: height is {}; allowed: 0 to 0.31 m'.format(height))
        way = abs(height - world.robot.position('torso_lift_joint'))
        super().__init__(['torso_lift_joint'], np.array([[height]]), np.array([max(way / TORSO_SPEED, PERIOD)]))

    def events(self) -> Sequence[str]:
        return ['torso']


class Head(Trajectory):
    """The camera's optical axis through a point."""

    def __init__(self, world: World, point: Sequence[float]) -> None:
        """Raises ValueError for a point (m, in BASE_FRAME) that is not finite, or that the head cannot turn to."""
        turn = head_angles(world.robot.position('torso_lift_joint'), point)
        here = [world.robot.position(name) for name in ('head_pan_joint', 'head_tilt_joint')]
        for name, angle in zip(('head_pan_joint', 'head_tilt_joint'), turn):
            if world.robot.refusal(name, angle):
                raise ValueError('cannot look at {}: {}'.format(
                    np.round(np.asarray(point, float), 3).tolist(), world.robot.refusal(name, angle)))
        span = max(0.2, float(np.abs(turn - here).max()) / HEAD_SPEED)
        super().__init__(['head_pan_joint', 'head_tilt_joint'], turn[None], np.array([span]), np.zeros((1, 2)))

    def events(self) -> Sequence[str]:
        return ['look_at']


@lru_cache(maxsize=1)
def _neck() -> Chain:
    return Chain.from_urdf(pr2_urdf().read_text(encoding='utf-8'), BASE_FRAME, CAMERA_FRAME)


def head_angles(torso: float, point: Sequence[float]) -> np.ndarray:
    """Pan and tilt (2,) rad that take the optical axis through a point (3,) of BASE_FRAME.

    :raises ValueError: for a point that is not finite, or at the camera itself.
    """
    if len(point) != 3 or not np.isfinite(point).all():
        raise ValueError('cannot look at {}: not three finite numbers'.format(list(point)))
    where = np.asarray(point, float)

    def miss(angles: np.ndarray) -> np.ndarray:
        seen = apply(inverse(_neck().forward(np.concatenate([[torso], angles]))), where)
        return np.array([np.arctan2(seen[0], seen[2]), np.arctan2(seen[1], np.hypot(seen[0], seen[2]))])
    angles = np.array([math.atan2(where[1], where[0]), 0.0])
    for _ in range(20):
        error = miss(angles)
        slope = np.column_stack([(miss(angles + step) - error) / 1e-6 for step in 1e-6 * np.eye(2)])
        angles = angles - np.clip(np.linalg.lstsq(slope, error, rcond=None)[0], -0.5, 0.5)
    if np.abs(miss(angles)).max() > 1e-3:
        raise ValueError('cannot look at {}: it is too near to the head'.format(where.tolist()))
    return (angles + np.pi) % (2 * np.pi) - np.pi


class Drive:
    """The base, straight and blindly, to where odometry says that the goal is."""

    def __init__(self, odom_from_goal: np.ndarray) -> None:
        """Raises ValueError for a goal that is no finite 4x4."""
        if np.shape(odom_from_goal) != (4, 4) or not np.isfinite(odom_from_goal).all():
            raise ValueError('drive: the goal is no finite 4x4 pose')
        self._goal = np.asarray(odom_from_goal, float)
        self._begun = -1

    def tick(self, world: World) -> Optional[Result]:
        if self._begun < 0:
            self._begin(world)
        done = (world.periods - self._begun) / self._periods
        here, there = (self._way(min(1.0, done + more)) for more in (0.0, 1.0 / self._periods))
        lag = np.abs([world.robot.position(name) - wanted for name, wanted in zip(BASE_JOINTS, here)]).max()
        if lag > 0.05:
            self.stop(world)
            return Result(False, 'the base is {:.2f} off its way (m or rad): something is in its way'.format(lag))
        if done >= 1.0:
            return self._arrive(world, done, lag)
        for name, before, after in zip(BASE_JOINTS, here, there):
            world.robot.set_target(name, after, (after - before) / PERIOD, None)
        share = _smooth(min(1.0, done + 1.0 / self._periods))
        world.belief_error = from_rpy((*(self._errors[0] + share * (self._errors[1] - self._errors[0]))[:2], 0.0),
                                      yaw=(self._errors[0] + share * (self._errors[1] - self._errors[0]))[2])
        return None

    def _begin(self, world: World) -> None:
        error = world.drive_error()
        true_goal = self._goal @ error
        self._begun = world.periods
        self._start = np.array([world.robot.position(name) for name in BASE_JOINTS])
        turn = (yaw_of(true_goal) - self._start[2] + np.pi) % (2 * np.pi) - np.pi
        self._change = np.array([*(true_goal[:2, 3] - self._start[:2]), turn])
        self._errors = [np.array([pose[0, 3], pose[1, 3], yaw_of(pose)]) for pose in (world.belief_error, error)]
        seconds = max(0.5, float(np.hypot(*self._change[:2])) / BASE_SPEED, abs(turn) / BASE_TURN)
        self._periods = math.ceil(seconds / PERIOD)

    def _way(self, share: float) -> np.ndarray:
        return self._start + _smooth(share) * self._change

    def _arrive(self, world: World, done: float, lag: float) -> Optional[Result]:
        for name, position in zip(BASE_JOINTS, self._way(1.0)):
            world.robot.set_target(name, position, 0.0, None)
        waited = (done - 1.0) * self._periods * PERIOD
        if lag < GOAL_TOLERANCE and waited >= SETTLE_S[0]:
            return Result(True)
        return Result(False, 'the base ended {:.2f} (m or rad) from its goal'.format(lag)) \
            if waited > SETTLE_S[1] else None

    def events(self) -> Sequence[str]:
        return ['drive']

    def stop(self, world: World) -> None:
        for name in BASE_JOINTS:
            world.robot.set_target(name, world.robot.position(name), 0.0, None)


def _smooth(share: float) -> float:
    return share * share * (3.0 - 2.0 * share)


def _held(world: World, name: str) -> float:
    """Where a joint was sent, if it is about there; else where it is."""
    target, position = world.robot.target(name), world.robot.position(name)
    return target if abs(target - position) < 0.02 else position


def _check_points(joints: List[str], positions: np.ndarray, times: np.ndarray,
                  velocities: Optional[np.ndarray]) -> None:
    count = len(joints)
    if not count or len(set(joints)) != count:
        raise ValueError('trajectory: joints are {}; allowed: at least one, none twice'.format(joints))
    if positions.ndim != 2 or positions.shape[1] != count or not len(positions) or times.shape != positions.shape[:1]:
        raise ValueError('trajectory: positions {} and times {} do not fit to {} joints'.format(
            positions.shape, times.shape, count))
    if velocities is not None and velocities.shape != positions.shape:
        raise ValueError('trajectory: velocities {} do not fit to positions {}'.format(
            velocities.shape, positions.shape))
    if not (np.isfinite(positions).all() and np.isfinite(times).all()
            and (velocities is None or np.isfinite(velocities).all())):
        raise ValueError('trajectory: a position, velocity or time is not finite')
    if times[0] < 0 or (np.diff(times) <= 0).any():
        raise ValueError('trajectory: times {} are not increasing from 0'.format(times.tolist()))
