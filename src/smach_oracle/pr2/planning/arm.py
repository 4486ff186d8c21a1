"""One arm for the time of one skill: its position, its reach, paths for it, and its motions."""

import contextlib
import zlib
from typing import Dict, Iterable, Iterator, List, Mapping, NamedTuple, Optional

import numpy as np

from smach_oracle.geometry.transforms import apply, from_rpy

from ..fingers import LEAST_GAP
from ..kitchen import MapBox
from ..robot import ARM_JOINTS, ARMS, FINGER_JOINTS, GRIPPER_OPEN, GripperState, Robot, RobotError
from ..work_costs import Work
from .collision import CollisionModel, CollisionWorld
from .planner import BUDGET, PlanningError, plan, straight, timed

FAST, SLOW = 0.45, 0.2  # of the joints' velocity limits
FEEL_EFFORT = 40.0  # N with which the gripper closes
READY = {
    'right': np.array([-0.4, 0.3, -1.2, -1.4, 0.0, -0.8, 0.0]),
    'left': np.array([0.4, 0.3, 1.2, -1.4, 0.0, -0.8, 0.0]),
}  # rad, a posture for work in front of the robot
TILT = 0.35  # rad, of what is held, on its way
LEVEL_BUDGET = 3000  # collision checks for such a way
ENOUGH = 3  # solutions of the inverse kinematics that are tried for one pose


class SkillError(Exception):
    """The robot could not do what it was asked to. The text is the reason, for people."""


class SkillContext(NamedTuple):
    """The robot of a skill, and the model of its body."""

    robot: Robot
    model: CollisionModel


def seed_of(*parts: object) -> int:
    """A seed made of the request and the state of things, never of the time.

    :param parts: arrays, numbers, text, dictionaries.
    """
    state = 0
    for part in parts:
        if isinstance(part, Mapping):
            part = sorted(part.items())
        data = part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode()
        state = zlib.crc32(data, state)
    return max(1, state & 0x7FFFFFFF)


class Arm:
    """An arm at work among boxes. Use it in a `with`. It then drops its collision world.

    Joint positions are (7,), rad. Poses are 4x4, base_footprint from tool.
    """

    def __init__(
        self, context: SkillContext, arm: str, boxes: Mapping[str, MapBox], seed: int
    ) -> None:
        """Build the arm's collision world.

        :param arm: 'left' or 'right'.
        :param boxes: obstacles by name, in base_footprint.
        :raises SkillError: for an unknown arm, or where the joints cannot be read.
        """
        self.name = arm
        self._robot = context.robot
        joints = encoder_readings(self._robot)
        try:
            self.space = CollisionWorld(context.model, arm, joints)
        except ValueError as err:
            raise SkillError(str(err)) from err
        try:
            for name in sorted(boxes):
                self.space.add_box(name, boxes[name])
        except Exception:
            self.space.close()
            raise
        self.chain = self.space.chain
        self.generator = np.random.default_rng(seed)
        self._spent, self._samples = self.space.checks, 0

    def __enter__(self) -> 'Arm':
        return self

    def __exit__(self, *_: object) -> None:
        self._spend()
        self.space.close()

    def _spend(self) -> None:
        """Let the time pass that planning has taken since the last motion."""
        checks, self._spent = self.space.checks - self._spent, self.space.checks
        samples, self._samples = self._samples, 0
        self._robot.spend('planning', Work(checks=checks, samples=samples))

    def now(self) -> np.ndarray:
        """Joint positions (7,), by the encoders."""
        return arm_positions(encoder_readings(self._robot), self.name)

    def pose(self) -> np.ndarray:
        """4x4, base_footprint from tool, by the encoders."""
        return self.chain.forward(self.now())

    def reach(
        self, pose: np.ndarray, near: Optional[np.ndarray] = None, restarts: int = 12
    ) -> List[np.ndarray]:
        """Joint positions free of collision that take the tool to `pose`, nearest to `near` first.

        :param near: where None, the arm's usual posture.
        :returns: (7,) each, or [] where all of them collide.
        :raises Unreachable: where no joint positions at all take it there.
        """
        seed = READY[self.name] if near is None else near
        self._samples += 1 + restarts
        found = self.chain.solutions(pose, seed, self.generator, restarts=restarts)
        if not len(found):
            raise Unreachable('out of reach')
        distinct: List[np.ndarray] = []
        for q in found:
            if all(np.abs(q - other).max() > 0.2 for other in distinct):
                distinct.append(q)
        return [q for q in distinct[: 2 * ENOUGH] if self.space.is_free(q)][:ENOUGH]

    def path(
        self, goal: np.ndarray, start: Optional[np.ndarray] = None, budget: int = BUDGET
    ) -> np.ndarray:
        """A path (m, 7) around the obstacles.

        :param start: (7,). Where None, where the arm is now.
        :param budget: collision checks at most.
        :raises PlanningError: where none is found.
        """
        return plan(
            self.space,
            self.now() if start is None else start,
            goal,
            int(self.generator.integers(1, 2**31)),
            budget,
        )

    def level_path(self, goal: np.ndarray, start: Optional[np.ndarray] = None) -> np.ndarray:
        """A path (m, 7) on which the hand tilts by at most TILT, where one is found.

        On any other one something slippery may turn in the hand.

        :param goal: (7,), start: as in path().
        :raises PlanningError: where no path is found at all.
        """
        here = self.now() if start is None else start
        with self.space.keeping_level(here, TILT):
            if self.space.is_free(self.chain.nearest_turn(goal, here)):
                try:
                    return self.path(goal, here, LEVEL_BUDGET)
                except PlanningError:
                    pass
        return self.path(goal, here)

    def line(self, start: np.ndarray, goal: np.ndarray) -> Optional[np.ndarray]:
        """A straight path (m, 7) of the tool from joint positions to a pose.

        :returns: None where there is none.
        """
        return straight(self.space, start, goal)

    def follow(self, path: np.ndarray, speed: float = FAST) -> None:
        """Move along a path (m, 7).

        :param speed: share of the joints' velocity limits.
        :raises SkillError: where the arm does not get there.
        """
        positions, times = timed(self.chain, path, speed)
        # encoders err: at a stop they may read a little beyond it, where nothing can be sent
        positions = self.chain.clip(positions)
        self._spend()
        try:
            self._robot.follow(ARM_JOINTS[self.name], positions, times)
        except RobotError as err:
            raise SkillError(
                'the {} arm did not follow its way: {}'.format(self.name, err)
            ) from err

    def go(self, goal: np.ndarray, speed: float = FAST, level: bool = False) -> None:
        """Plan and move to joint positions, as `follow` does.

        :param level: whether to take a level_path().
        :raises SkillError: where no path is found, or the arm does not get there.
        """
        try:
            path = self.level_path(goal) if level else self.path(goal)
        except PlanningError as err:
            raise SkillError(str(err)) from err
        self.follow(path, speed)

    def open(self, gap: float = GRIPPER_OPEN) -> None:
        """Open the gripper to `gap` m between the tips.

        :raises SkillError: where it does not open as far.
        """
        state = self._gripper(gap)
        # something that it held may have got in the way of a finger
        if state.position < gap - 0.015:
            state = self._gripper(gap)
        if state.position < gap - 0.015:
            raise SkillError(
                'the {} gripper opened only {:.1f} of {:.1f} cm'.format(
                    self.name, 100 * state.position, 100 * gap
                )
            )
        self._set_fingers()

    def close(self, effort: float = FEEL_EFFORT) -> float:
        """Close the gripper with `effort` N.

        :returns: m, the gap that something keeps open, or 0 where there is nothing.
        :raises SkillError: where the gripper fails.
        """
        state = self._gripper(0.0, effort)
        self._set_fingers()
        return state.position if state.stalled and state.position > LEAST_GAP else 0.0

    def gap(self) -> float:
        """m between the finger tips, by the encoders."""
        joints = encoder_readings(self._robot)
        return float(sum(joints[name] for name in FINGER_JOINTS[self.name]))

    @contextlib.contextmanager
    def opened(self, gap: float) -> Iterator[None]:
        """While this holds, the collision world's fingers stand `gap` m apart."""
        before = encoder_readings(self._robot)
        fingers = FINGER_JOINTS[self.name]
        self.space.place_rest({name: gap / len(fingers) for name in fingers})
        try:
            yield
        finally:
            self.space.place_rest({name: before[name] for name in fingers})

    def _gripper(self, gap: float, effort: float = 50.0) -> GripperState:
        self._spend()
        try:
            return self._robot.gripper(self.name, gap, effort)
        except RobotError as err:
            raise SkillError('the {} gripper: {}'.format(self.name, err)) from err

    def _set_fingers(self) -> None:
        """Take the collision world's fingers to the encoders' readings."""
        joints = encoder_readings(self._robot)
        self.space.place_rest(
            {name: value for name, value in joints.items() if '_finger_joint' in name}
        )


def known_arm(arm: str) -> str:
    """The arm, if there is one of this name.

    :raises SkillError: for an unknown one.
    """
    if arm not in ARMS:
        raise SkillError('unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))
    return arm


class Unreachable(Exception):
    """No joint positions take the tool to a pose."""


def encoder_readings(robot: Robot) -> Dict[str, float]:
    """Encoder readings, rad or m by joint.

    :raises SkillError: where there are none.
    """
    try:
        return dict(robot.joints())
    except RobotError as err:
        raise SkillError('the joints cannot be read: {}'.format(err)) from err


def arm_positions(joints: Mapping[str, float], arm: str) -> np.ndarray:
    """(7,) rad of an arm out of encoder readings.

    :raises SkillError: where one is missing.
    """
    missing = [name for name in ARM_JOINTS[arm] if name not in joints]
    if missing:
        raise SkillError('no encoder reading of {}'.format(', '.join(missing)))
    return np.array([joints[name] for name in ARM_JOINTS[arm]])


def lifted(pose: np.ndarray, height: float) -> np.ndarray:
    """A pose (4x4) moved upwards by `height` m."""
    return from_rpy((0.0, 0.0, height)) @ pose


def backed_off(pose: np.ndarray, distance: float) -> np.ndarray:
    """A pose (4x4) of the tool, moved back along its own x axis by `distance` m."""
    moved = pose.copy()
    moved[:3, 3] = apply(pose, np.array([-distance, 0.0, 0.0]))
    return moved


def summary(reasons: Iterable[str]) -> str:
    """Count each reason, the most frequent first: '5 times out of reach, 2 times ...'."""
    counted: Dict[str, int] = {}
    for reason in reasons:
        counted[reason] = counted.get(reason, 0) + 1
    return ', '.join(
        '{} times {}'.format(number, reason)
        for reason, number in sorted(counted.items(), key=lambda item: (-item[1], item[0]))
    )
