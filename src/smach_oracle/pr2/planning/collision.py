"""Collisions of an arm: the robot at its encoder readings among boxes, in a PyBullet client.

The client is apart from the world's: it knows what the robot has measured. It is cleaned before
each skill, so that no answer depends on what was asked before. Lengths in m, angles in rad, frame:
base_footprint.
"""

import contextlib
from typing import Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Set, Tuple

import numpy as np
import pybullet

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import VectorLike, quaternion

from ..kitchen import MapBox
from ..robot import ARMS, BASE_FRAME, TOOL_FRAME
from .collision_body import BodyPool, CollisionBody, CollisionModel, installed_model, model_from

__all__ = ['CollisionModel', 'CollisionWorld', 'installed_model', 'model_from']
TOUCH = 0.001  # m that hulls may overlap: they are somewhat larger than the links
_FAR = (0.0, 0.0, -50.0)
_POOL = BodyPool()


class CollisionWorld:
    """One arm among everything else: the rest of the robot, boxes, and what the hand holds."""

    def __init__(self, model: CollisionModel, arm: str, joints: Mapping[str, float]) -> None:
        """Put the robot into a client of its own.

        :param arm: the arm that moves, 'left' or 'right'. All other joints stay as in `joints`.
        :param joints: encoder readings. Joints that are missing stand at 0.
        :raises ValueError: for an unknown arm, or a description that cannot be loaded.
        """
        if arm not in ARMS:
            raise ValueError('arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))
        lift = 'torso_lift_joint'
        self.chain = JointChain.from_urdf(
            model.urdf, BASE_FRAME, TOOL_FRAME[arm], fixed={lift: joints.get(lift, 0.0)}
        )
        self.checks = 0  # how often a configuration was looked at, the measure of planning effort
        self._boxes: Dict[str, int] = {}
        self._held: Optional[Tuple[int, np.ndarray]] = None
        self._touchable: Set[int] = set()
        self._level: Optional[Tuple[np.ndarray, float]] = None
        self._key = (model, arm)
        self._lent: Optional[CollisionBody] = _POOL.lend(model, arm)
        self._client, self._robot, self._arm = (self._lent.client, self._lent.robot, self._lent.arm)
        self._links, self._pairs = self._lent.links, self._lent.pairs
        self._moving, self._hand = self._lent.moving, self._lent.hand
        try:
            self.place_rest(joints)
        except Exception:
            self.close()
            raise

    def __enter__(self) -> 'CollisionWorld':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the client back. The object cannot be used afterwards."""
        lent, self._lent = self._lent, None
        if lent is not None:
            for name in self.names():
                self.remove(name)
            self.detach()
            _POOL.take_back(*self._key, lent)

    def place_rest(self, joints: Mapping[str, float]) -> None:
        """Set the joints of everything but the arm (and of the gripper) to encoder readings."""
        if self._lent is not None:
            self._lent.place(joints)

    def add_box(self, name: str, box: MapBox) -> None:
        """An obstacle. A box of the same name is replaced."""
        self.remove(name)
        self._boxes[name] = self._body(
            box.half,
            0.0,
            box.centre,
            (0.0, 0.0, np.sin(box.yaw / 2), np.cos(box.yaw / 2)),
            box.upright_cylinder,
        )

    def remove(self, name: str) -> None:
        """Drop an obstacle, if it is there."""
        body = self._boxes.pop(name, None)
        if body is not None:
            self._touchable.discard(body)
            pybullet.removeBody(body, physicsClientId=self._client)

    def names(self) -> List[str]:
        """Return the names of all obstacles."""
        return sorted(self._boxes)

    def attach(self, half: VectorLike, tool_from_object: np.ndarray) -> None:
        """Let the hand hold a box, which it may touch.

        :param half: (3,) m, half extents.
        :param tool_from_object: 4x4.
        """
        self.detach()
        self._held = (self._body(half, 0.1, _FAR, (0.0, 0.0, 0.0, 1.0)), tool_from_object)

    def detach(self) -> None:
        """The hand holds nothing any more."""
        if self._held is not None:
            pybullet.removeBody(self._held[0], physicsClientId=self._client)
            self._held = None

    @contextlib.contextmanager
    def touchable(self, names: Iterable[str]) -> Iterator[None]:
        """While this holds, hand and held object may touch these obstacles. The arm may not."""
        before = self._touchable
        self._touchable = before | {self._boxes[name] for name in names if name in self._boxes}
        try:
            yield
        finally:
            self._touchable = before

    @contextlib.contextmanager
    def keeping_level(self, q: np.ndarray, tilt: float) -> Iterator[None]:
        """While this holds, joint positions are free only where the hand tilts by so little.

        :param q: (7,), where what it holds is upright.
        :param tilt: rad.
        """
        before = self._level
        self._level = self.chain.forward(q)[2, :3], float(np.cos(tilt))
        try:
            yield
        finally:
            self._level = before

    def is_free(self, q: np.ndarray) -> bool:
        """Whether the arm (and what it holds) touches nothing at joint positions (7,)."""
        if self._level is not None:
            upright, least = self._level
            if self.chain.forward(q)[2, :3] @ upright < least:
                self.checks += 1  # it costs the planner as much of its budget
                return False
        return next(self._collisions(q), None) is None

    def why_not(self, q: np.ndarray) -> str:
        """Say what touches what at joint positions (7,), or return '' where nothing does."""
        names = {index: name for name, index in self._links.items()}
        bodies = {body: name for name, body in self._boxes.items()}
        found = set()
        for one, other in self._collisions(q):
            found.add(
                ' touches '.join(
                    names.get(link, BASE_FRAME)
                    if body == self._robot
                    else bodies.get(body, 'the held object')
                    for body, link in (one, other)
                )
            )
        return '; '.join(sorted(found))

    def distance(self, q: np.ndarray, reach: float = 0.1) -> float:
        """The least distance (m, below 0 inside) of the arm to anything that it must not touch.

        :param reach: m, the most that is returned.
        """
        self._pose(q)
        least = reach
        for body in self._boxes.values():
            if body not in self._touchable:
                least = self._nearest(self._robot, body, least, moving_only=True)
                if self._held is not None:
                    least = self._nearest(self._held[0], body, least)
        for one, other in self._pairs:
            points = pybullet.getClosestPoints(
                self._robot, self._robot, least, one, other, physicsClientId=self._client
            )
            least = min([least] + [point[8] for point in points])
        return least

    def _nearest(self, one: int, other: int, least: float, moving_only: bool = False) -> float:
        moving = self._moving if moving_only else None
        points = pybullet.getClosestPoints(one, other, least, physicsClientId=self._client)
        return min([least] + [point[8] for point in points if moving is None or point[3] in moving])

    def _collisions(self, q: np.ndarray) -> Iterator[Tuple[Tuple[int, int], Tuple[int, int]]]:
        """Pairs of (body, link) that touch and must not."""
        self.checks += 1
        self._pose(q)
        pybullet.performCollisionDetection(physicsClientId=self._client)
        held = -1 if self._held is None else self._held[0]
        for contact in pybullet.getContactPoints(bodyA=self._robot, physicsClientId=self._client):
            if contact[8] > -TOUCH:
                continue
            one, other = (contact[1], contact[3]), (contact[2], contact[4])
            if one[0] != self._robot:
                one, other = other, one
            by_hand = one[1] in self._hand
            if by_hand and (other[0] == held or other[0] in self._touchable):
                continue
            yield one, other
        if held >= 0:
            for contact in pybullet.getContactPoints(bodyA=held, physicsClientId=self._client):
                bodies = {contact[1], contact[2]} - {held}
                others = self._robot not in bodies and not bodies & self._touchable
                if contact[8] <= -TOUCH and others:
                    yield (held, -1), (bodies.pop(), -1)

    def _pose(self, q: np.ndarray) -> None:
        pybullet.resetJointStatesMultiDof(
            self._robot, self._arm, [[float(value)] for value in q], physicsClientId=self._client
        )
        if self._held is not None:
            body, tool_from_object = self._held
            pose = self.chain.forward(q) @ tool_from_object
            pybullet.resetBasePositionAndOrientation(
                body, pose[:3, 3].tolist(), quaternion(pose).tolist(), physicsClientId=self._client
            )

    def _body(
        self,
        half: VectorLike,
        mass: float,
        position: VectorLike,
        xyzw: Sequence[float],
        upright_cylinder: bool = False,
    ) -> int:
        if upright_cylinder:
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_CYLINDER,
                radius=float(max(half[0], half[1])),
                height=2 * float(half[2]),
                physicsClientId=self._client,
            )
        else:
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_BOX,
                halfExtents=[float(each) for each in half],
                physicsClientId=self._client,
            )
        return int(
            pybullet.createMultiBody(
                mass,
                shape,
                -1,
                [float(each) for each in position],
                [float(each) for each in xyzw],
                physicsClientId=self._client,
            )
        )
