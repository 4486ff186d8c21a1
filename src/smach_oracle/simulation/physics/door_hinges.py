"""Doors that fall shut by themselves, as those of many refrigerators do, and dry friction."""

from typing import Dict, List, Mapping, Tuple

import pybullet

from ..scenes.scene import ClosingHinge
from .bodies import PlacedBody

TURNING_FORCE = 30.0  # N m, of a person who swings a door
SHUT = 0.01  # rad: a door nearer than that to its frame is shut


class DoorHinges:
    """The hinges of a scene."""

    def __init__(self, client: int, placed: Mapping[str, PlacedBody]) -> None:
        self._client = client
        self._placed = placed
        self._closing: List[Tuple[str, str, ClosingHinge]] = [
            (name, joint, hinge)
            for name, each in placed.items()
            for joint, hinge in each.body.joint_closing
        ]
        self._driven: Dict[Tuple[str, str], bool] = {}  # by a person, just now
        self._sucked: Dict[Tuple[str, str], float] = {}  # N m that hold it shut

    def tick(self) -> None:
        """Pull doors shut that are not past their stop, in the coming control period."""
        for name, joint, hinge in self._closing:
            if self._driven.get((name, joint)):
                continue
            angle = self._angle(name, joint)
            if SHUT < angle < hinge.stop:
                self._drive(name, joint, -hinge.pace, hinge.torque)
            else:
                self._drive(name, joint, 0.0, self._friction(name, joint))

    def suck(self, name: str, joint: str, torque: float) -> bool:
        """Hold a joint where it is with a torque (N m), as long as the door is shut.

        :returns: whether it is. Where it is not, air has come in, and nothing holds it any more.
        """
        shut = self._angle(name, joint) < SHUT
        self._sucked[name, joint] = torque if shut else 0.0
        if not self._driven.get((name, joint)):
            self._drive(name, joint, 0.0, self._friction(name, joint))
        return shut

    def turn(self, name: str, joint: str, speed: float) -> None:
        """Drive a joint at rad/s with a person's strength. What is in its way stops it."""
        self._driven[name, joint] = True
        self._drive(name, joint, speed, TURNING_FORCE)

    def let_go(self, name: str, joint: str) -> None:
        """Leave a joint to its hinge again."""
        self._driven[name, joint] = False
        self._drive(name, joint, 0.0, self._friction(name, joint))

    def _friction(self, name: str, joint: str) -> float:
        dry = dict(self._placed[name].body.joint_friction).get(joint, 0.0)
        return dry + self._sucked.get((name, joint), 0.0)

    def _angle(self, name: str, joint: str) -> float:
        angle: float = pybullet.getJointState(
            self._placed[name].number,
            self._placed[name].joints[joint],
            physicsClientId=self._client,
        )[0]
        return angle

    def _drive(self, name: str, joint: str, speed: float, torque: float) -> None:
        placed = self._placed[name]
        pybullet.setJointMotorControl2(
            placed.number,
            placed.joints[joint],
            pybullet.VELOCITY_CONTROL,
            targetVelocity=speed,
            force=torque,
            physicsClientId=self._client,
        )
