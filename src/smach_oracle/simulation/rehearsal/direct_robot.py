"""The PR2 in the same process as its world: for unit tests, and for tuning. The Robot protocol without ROS."""
from typing import Callable, Dict, Sequence

import numpy as np

from ..robot.interface import Frame, GripperState, RobotError
from .camera import see
from .motions import Drive, Gripper, Head, Torso
from .physics import World
from .trajectory import Motion, Result, Trajectory, run


class DirectRobot:
    """Drives the PR2 of a world; every call returns when the motion has ended.

    Values that cannot be, and motions that do not get there, raise RobotError.
    """

    def __init__(self, world: World) -> None:
        self._world = world

    def joints(self) -> Dict[str, float]:
        """See Robot."""
        return self._world.joints()

    def odom_from_base(self) -> np.ndarray:
        """See Robot."""
        return self._world.odom_from_base()

    def follow(self, joints: Sequence[str], positions: np.ndarray, times: np.ndarray) -> None:
        """See Robot."""
        self._do(lambda: Trajectory(joints, positions, times))

    def gripper(self, arm: str, position: float, max_effort: float = 50.0) -> GripperState:
        """See Robot. Raises RobotError where the gripper does not tell how it ended, too."""
        state = self._do(lambda: Gripper(arm, position, max_effort)).gripper
        if state is None:
            raise RobotError('the {} gripper does not tell its state'.format(arm))
        return state

    def torso(self, height: float) -> None:
        """See Robot."""
        self._do(lambda: Torso(self._world, height))

    def look_at(self, point: Sequence[float]) -> None:
        """See Robot."""
        self._do(lambda: Head(self._world, point))

    def drive(self, odom_from_goal: np.ndarray) -> None:
        """See Robot."""
        self._do(lambda: Drive(odom_from_goal))

    def see(self) -> Frame:
        """See Robot."""
        return see(self._world)

    def _do(self, make: Callable[[], Motion]) -> Result:
        try:
            result = run(self._world, make())
        except ValueError as err:
            raise RobotError(str(err)) from err
        if not result.ok:
            raise RobotError(result.text)
        return result
