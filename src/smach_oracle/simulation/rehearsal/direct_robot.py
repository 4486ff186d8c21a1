"""The PR2 in the same process as its world, without ROS: for unit tests, and for tuning."""

from typing import Callable, Dict, Sequence

import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.transforms import VectorLike
from smach_oracle.pr2.robot import GripperState, RobotError
from smach_oracle.pr2.work_costs import Work

from ..physics.camera import see
from ..physics.motions import BaseMotion, GripperMotion, HeadMotion, TorsoMotion
from ..physics.passing import pass_time
from ..physics.pr2_body import PERIOD
from ..physics.trajectory import Motion, MotionResult, Trajectory, run
from ..physics.world import World


def no_report(status: str) -> None:
    """Report to nobody: for skills whose progress nobody follows."""


class DirectRobot:
    """Drives the PR2 of a world. Every call returns when the motion has ended.

    Values that are not allowed, and motions that do not get there, raise RobotError.
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
        """See Robot.

        :raises RobotError: also where the gripper has no state at its end.
        """
        state = self._do(lambda: GripperMotion(arm, position, max_effort)).gripper
        if state is None:
            raise RobotError('the {} gripper does not tell its state'.format(arm))
        return state

    def torso(self, height: float) -> None:
        """See Robot."""
        self._do(lambda: TorsoMotion(self._world, height))

    def look_at(self, point: VectorLike) -> None:
        """See Robot."""
        self._do(lambda: HeadMotion(self._world, point))

    def drive(self, odom_from_goal: np.ndarray) -> None:
        """See Robot."""
        self._do(lambda: BaseMotion(odom_from_goal))

    def localise(self, odom_from_base: np.ndarray) -> None:
        """See Robot."""
        self._world.localise(odom_from_base)

    def see(self) -> CameraImage:
        """See Robot."""
        image = see(self._world)
        self.spend('perception', Work(images=1))
        return image

    def spend(self, what: str, work: Work) -> None:
        """See Robot."""
        pass_time(self._world, round(work.seconds / PERIOD))

    def _do(self, make: Callable[[], Motion]) -> MotionResult:
        try:
            result = run(self._world, make())
        except ValueError as err:
            raise RobotError(str(err)) from err
        if not result.ok:
            raise RobotError(result.text)
        return result
