"""The weight of things, in a world whose gravity is 0.

A PR2's arms are balanced by springs and counterweights, and spindle and wheels carry the rest of
it: to its motors it weighs nothing. The physics engine knows one gravity for all. So there is none,
and each step of physics pulls at the things alone.
"""

from typing import Iterable, Sequence

import pybullet

from .bodies import PlacedBody

GRAVITY = 9.81  # m/s2


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
