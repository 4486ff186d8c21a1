"""What the robot's hands hold, as far as it can know: by what it did with them, and by its fingers.

A hand that has opened, or has closed on nothing, holds nothing. So what a hand held once does not
count for good, as in the next trial. The looks of the thing that a hand was sent to take count
until it is sent for another: whoever has put it down looks whether it stands.
"""

from typing import Dict, Optional, Sequence, Set

import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.transforms import VectorLike

from ..fingers import LEAST_GAP, may_hold
from ..perception.upright import UNKNOWN, StandingLook
from ..planning.arm import encoder_readings
from ..robot import GripperState, Robot
from ..work_costs import Work
from .pick import HeldObject


class HandMemory:
    """Remembers what each hand holds."""

    def __init__(self) -> None:
        self._held: Dict[str, HeldObject] = {}
        self._meant: Dict[str, StandingLook] = {}
        self._lost: Set[str] = set()

    def keep(self, arm: str, held: HeldObject) -> None:
        """A hand holds this from now on."""
        self._held[arm] = held

    def find(self, arm: str) -> Optional[HeldObject]:
        """Return what a hand holds, or None where nothing is known of it."""
        return self._held.get(arm)

    def send(self, arm: str, look: StandingLook) -> None:
        """A hand is sent to take a thing that looks like this."""
        self._meant[arm] = look
        self._lost.discard(arm)

    def meant(self, arm: str) -> StandingLook:
        """Return the looks of the thing that a hand was last sent to take."""
        return self._meant.get(arm, UNKNOWN)

    def lose(self, arm: str) -> None:
        """A hand has lost its thing on the way."""
        self._lost.add(arm)

    def has_lost(self, arm: str) -> bool:
        """Whether a hand has lost the thing that it was last sent to take."""
        return arm in self._lost

    def forget(self, arm: str) -> None:
        """A hand holds nothing that is known."""
        self._held.pop(arm, None)

    def feel(self, robot: Robot) -> None:
        """Forget what hands have held whose fingers show that they hold nothing.

        :raises SkillError: where the joints cannot be read.
        """
        if self._held:
            joints = encoder_readings(robot)
            for arm in list(self._held):
                if not may_hold(joints, arm):
                    self.forget(arm)


class MindfulRobot:
    """A Robot whose hands are watched: what they let go of is forgotten."""

    def __init__(self, robot: Robot, hands: HandMemory) -> None:
        self._robot = robot
        self._hands = hands

    def gripper(self, arm: str, position: float, max_effort: float = 50.0) -> GripperState:
        """See Robot. A hand that was stopped while it opened may still hold something."""
        state = self._robot.gripper(arm, position, max_effort)
        if position > 0 or state.position <= LEAST_GAP:
            self._hands.forget(arm)
        return state

    def joints(self) -> Dict[str, float]:
        """See Robot."""
        return self._robot.joints()

    def odom_from_base(self) -> np.ndarray:
        """See Robot."""
        return self._robot.odom_from_base()

    def localise(self, odom_from_base: np.ndarray) -> None:
        """See Robot."""
        self._robot.localise(odom_from_base)

    def follow(self, joints: Sequence[str], positions: np.ndarray, times: np.ndarray) -> None:
        """See Robot."""
        self._robot.follow(joints, positions, times)

    def torso(self, height: float) -> None:
        """See Robot."""
        self._robot.torso(height)

    def look_at(self, point: VectorLike) -> None:
        """See Robot."""
        self._robot.look_at(point)

    def drive(self, odom_from_goal: np.ndarray) -> None:
        """See Robot."""
        self._robot.drive(odom_from_goal)

    def see(self) -> CameraImage:
        """See Robot."""
        return self._robot.see()

    def spend(self, what: str, work: Work) -> None:
        """See Robot."""
        self._robot.spend(what, work)
