"""An arm that is told where to go: it plans among what is known to be there, and moves."""
from typing import Dict, Iterable, Mapping, Optional, Tuple

import numpy as np

from .collision import CollisionWorld, RobotModel
from .interface import ARM_JOINTS, ARMS, Robot
from .kitchen import MapBox
from .planner import PlanningError, plan, straight, timed

# Compact beside the body, out of the camera's view: the left hand before the chest, the right arm to the right
TRAVEL: Dict[str, Tuple[float, ...]] = {'left': (0.24, 1.24, 1.42, -1.89, -0.07, -1.98, 0.35),
                                        'right': (-1.6, 0.2, -1.5, -1.5, 0.5, -0.6, 0.0)}
AT_REST = 0.05  # rad from a posture that count as being there


class Limb:
    """One arm during one skill, among boxes that its collision space holds."""

    def __init__(self, robot: Robot, model: RobotModel, arm: str, boxes: Mapping[str, MapBox], seed: int) -> None:
        """
        :param arm: 'left' or 'right'.
        :param boxes: obstacles by name, in the frame of the base.
        :param seed: of all that is drawn at random.
        :raises ValueError: for an unknown arm.
        """
        check_arm(arm)
        self.robot = robot
        self.arm = arm
        self.seed = seed
        self.space = CollisionWorld(model, arm, robot.joints())
        for name, box in boxes.items():
            self.space.add_box(name, box)

    def __enter__(self) -> 'Limb':
        return self

    def __exit__(self, *_: object) -> None:
        self.space.close()

    def where(self) -> np.ndarray:
        """(7,) joint positions now."""
        joints = self.robot.joints()
        return np.array([joints[name] for name in ARM_JOINTS[self.arm]])

    def tool(self) -> np.ndarray:
        """4x4, base from tool, now."""
        return self.space.chain.forward(self.where())

    def go(self, goal: np.ndarray, speed: float = 0.6) -> None:
        """Go to joint positions (7,), around what is in the way. Raises PlanningError, RobotError."""
        start = self.where()
        if np.abs(self.space.chain.nearest_turn(np.asarray(goal), start) - start).max() > AT_REST:
            self.follow(plan(self.space, start, goal, self.seed), speed)

    def line(self, goal: np.ndarray, touching: Iterable[str] = (), speed: float = 0.3) -> None:
        """Take the tool along a straight line to a pose (4x4).

        :param touching: obstacles that the hand may touch.
        :raises PlanningError: where there is no such line. RobotError where it was not followed.
        """
        with self.space.touchable(touching):
            way = straight(self.space, self.where(), goal)
        if way is None:
            raise PlanningError('no straight way for the {} hand to {}'.format(self.arm, _words(goal)))
        self.follow(way, speed)

    def back(self, length: float, touching: Iterable[str] = (), speed: float = 0.3) -> None:
        """Draw the hand straight back by up to `length` m, as far as there is a way."""
        here = self.tool()
        for share in (1.0, 0.7, 0.4):
            goal = here.copy()
            goal[:3, 3] -= share * length * here[:3, 0]
            with self.space.touchable(touching):
                way = straight(self.space, self.where(), goal)
            if way is not None:
                self.follow(way, speed)
                return

    def follow(self, way: np.ndarray, speed: float) -> None:
        """Follow joint positions (m, 7), the first of them being where the arm is. Raises RobotError."""
        points, times = timed(self.space.chain, way, speed)
        self.robot.follow(ARM_JOINTS[self.arm], points, times)


def check_arm(arm: str) -> None:
    """Raise ValueError for an unknown arm."""
    if arm not in ARMS:
        raise ValueError('unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))


def stow(robot: Robot, model: RobotModel, arms: Iterable[str], boxes: Mapping[str, MapBox], seed: int) -> None:
    """Take arms to their postures for driving. Raises PlanningError, RobotError."""
    for arm in arms:
        with Limb(robot, model, arm, boxes, seed) as limb:
            limb.go(np.array(TRAVEL[arm]))


def _words(pose: Optional[np.ndarray]) -> str:
    return '({:.2f}, {:.2f}, {:.2f}) m'.format(*pose[:3, 3])
