"""The weight of things, in a world whose gravity is 0, and what sticks to where it stands.

A PR2's arms are balanced by springs and counterweights, and spindle and wheels carry the rest of
it: to its motors it weighs nothing. The physics engine knows one gravity for all. So there is none,
and each step of physics pulls at the things alone.
"""

from typing import Iterable, Sequence

import numpy as np
import pybullet

from smach_oracle.geometry.transforms import apply

from .bodies import PlacedBody

GRAVITY = 9.81  # m/s2


COMES_OFF = 0.004  # m that a thing which sticks is pulled away, where it comes off


class StickingThing:
    """A thing that sticks to what it stands on, by the middle of its lower end."""

    def __init__(self, client: int, placed: PlacedBody, pose: np.ndarray, force: float) -> None:
        """
        :param pose: 4x4, of its centre, in the world.
        :param force: N that it is held with at most, along each axis.
        """
        self._client = client
        self._low = np.array([0.0, 0.0, -placed.body.size[2] / 2])
        self._place = apply(pose, self._low)
        self._constraint: int = pybullet.createConstraint(
            placed.number,
            -1,
            -1,
            -1,
            pybullet.JOINT_POINT2POINT,
            [0.0, 0.0, 0.0],
            self._low.tolist(),
            self._place.tolist(),
            physicsClientId=client,
        )
        pybullet.changeConstraint(self._constraint, maxForce=force, physicsClientId=client)

    def comes_off(self, pose: np.ndarray) -> bool:
        """Let go of it where it has been pulled away. `pose` as above. Whether it was let go."""
        off = float(np.linalg.norm(apply(pose, self._low) - self._place)) > COMES_OFF
        if off:
            pybullet.removeConstraint(self._constraint, physicsClientId=self._client)
        return off


class Weights:
    """The weights of what can be carried or can fall."""

    def __init__(self, client: int, placed: Iterable[PlacedBody]) -> None:
        """Find out what has a weight: all but what stands fast, and the parts that hang on it.

        The only such part is a door, which swings about a vertical hinge: its weight moves nothing.
        """
        self._client = client
        self._pulls = []
        for each in placed:
            for link in each.links.values() if each.body.mass > 0 else ():
                mass = pybullet.getDynamicsInfo(each.number, link, physicsClientId=client)[0]
                self._pulls.append((each.number, link, [0.0, 0.0, -GRAVITY * mass]))

    def pull(self) -> None:
        """Pull for the coming step of physics."""
        for number, link, force in self._pulls:
            pybullet.applyExternalForce(
                number,
                link,
                force,
                self._centre(number, link),
                pybullet.WORLD_FRAME,
                physicsClientId=self._client,
            )

    def _centre(self, number: int, link: int) -> Sequence[float]:
        """(3,) m in the world, the centre of mass of a link. -1 is the root."""
        state: Sequence[Sequence[float]] = (
            pybullet.getBasePositionAndOrientation(number, physicsClientId=self._client)
            if link < 0
            else pybullet.getLinkState(number, link, physicsClientId=self._client)
        )
        return state[0]
