"""Distances of an arm to the robot's own body, from its URDF, and to boxes around it.

A PyBullet world of its own, without physics: it only measures distances between convex shapes.
"""

import os
import tempfile
from types import ModuleType
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.joints import read_joints
from smach_oracle.geometry.transforms import quaternion

from .cartesian_drive import Clearance

PYBULLET = 'pybullet==3.2.7'
# pairs of links that are as near in more than this share of all postures are left out
_ALWAYS_NEAR = 0.5
_SAMPLES = 40
# m. Deeper than a robot can be in itself: its convex shapes are larger than the links
_OVERLAP = -0.02

Pair = Tuple[int, int]  # links, by PyBullet's indices


class ClearanceError(ValueError):
    """The robot's model cannot be used. The text says why."""


def load_pybullet() -> ModuleType:
    """Import PyBullet, only where distances are wanted: not every robot has it.

    :raises ClearanceError: where it cannot be imported, with what would bring it.
    """
    try:
        import pybullet
    except ImportError as err:
        raise ClearanceError('needs PyBullet ({}): pip install {}'.format(err, PYBULLET)) from err
    return pybullet


class CollisionBox(NamedTuple):
    """A box in the robot's surroundings."""

    name: str
    base_from_box: np.ndarray  # 4x4, the robot's base frame from the box's centre
    size: Tuple[float, float, float]  # m, full extents


class ClearanceModel:
    """The robot and the boxes around it. Not for several threads at once."""

    def __init__(self, urdf: str, base: str) -> None:
        """
        :param urdf: text of the model, with mesh file names that can be opened.
        :param base: frame in which boxes are given.
        :raises ClearanceError: where PyBullet is missing or cannot load it, or the frame is not in
            it.
        """
        self._bullet = load_pybullet()
        self._client = self._bullet.connect(self._bullet.DIRECT)
        self._robot = self._load(urdf)
        self._joint_of_link = read_joints(urdf)
        self._links: Dict[str, int] = {}
        self._joints: Dict[str, int] = {}
        for index in range(self._bullet.getNumJoints(self._robot, physicsClientId=self._client)):
            info = self._bullet.getJointInfo(self._robot, index, physicsClientId=self._client)
            self._joints[info[1].decode()] = index
            self._links[info[12].decode()] = index
        if base not in self._links and base not in {
            joint.parent for joint in self._joint_of_link.values()
        }:
            raise ClearanceError('robot description: no link {!r}'.format(base))
        self._names = {index: name for name, index in self._links.items()}
        self._names[-1] = 'base'
        self._base = base
        self._boxes: List[Tuple[int, str]] = []

    def set_joints(self, positions: Mapping[str, float]) -> None:
        """Set where the joints are (rad or m). Names that the model does not have are left out."""
        known = [
            (self._joints[name], [position])
            for name, position in positions.items()
            if name in self._joints
        ]
        if known:
            self._bullet.resetJointStatesMultiDof(
                self._robot, *map(list, zip(*known)), physicsClientId=self._client
            )

    def set_boxes(self, boxes: Sequence[CollisionBox]) -> None:
        """Replace the boxes around the robot."""
        for body, _ in self._boxes:
            self._bullet.removeBody(body, physicsClientId=self._client)
        self._boxes = [(self._box(box), box.name) for box in boxes]

    def arm(self, chain: JointChain, within: float) -> 'ArmClearance':
        """Distances of one arm, as far as they are below `within` m."""
        return ArmClearance(self, chain, within)

    def carried_by(self, joints: Sequence[str]) -> Set[int]:
        """Indices of the links that move with any of these joints."""
        moving = set()
        for link, index in self._links.items():
            name: Optional[str] = link
            while name in self._joint_of_link:
                if self._joint_of_link[name].name in joints:
                    moving.add(index)
                    break
                name = self._joint_of_link[name].parent
        return moving

    def own_pairs(self, moving: Set[int]) -> List[Pair]:
        """Pairs of a moving link and another one of the robot that both have a shape."""
        shaped = [
            index
            for index in self._names
            if self._bullet.getCollisionShapeData(self._robot, index, physicsClientId=self._client)
        ]
        return [
            (first, second)
            for first in shaped
            if first in moving
            for second in shaped
            if second not in moving
        ]

    def distance(self, pair: Pair, within: float) -> float:
        """Distance (m) between two links, inf from `within` on."""
        points = self._bullet.getClosestPoints(
            self._robot, self._robot, within, *pair, physicsClientId=self._client
        )
        return min((point[8] for point in points), default=float('inf'))

    def near_boxes(self, moving: Set[int], within: float) -> Optional[Tuple[float, str]]:
        """The least distance (m) between a moving link and a box, with the names of both."""
        best: Optional[Tuple[float, str]] = None
        for body, name in self._boxes:
            for point in self._bullet.getClosestPoints(
                self._robot, body, within, physicsClientId=self._client
            ):
                if point[3] in moving and (best is None or point[8] < best[0]):
                    best = point[8], '{} and {}'.format(self._names[point[3]], name)
        return best

    def pair_name(self, pair: Pair) -> str:
        """A pair of links, for people."""
        return '{} and {}'.format(self._names[pair[0]], self._names[pair[1]])

    def close(self) -> None:
        """Let go of the PyBullet world."""
        self._bullet.disconnect(self._client)

    def _load(self, urdf: str) -> int:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'robot.urdf')
            with open(path, 'w', encoding='utf-8') as file:
                file.write(urdf)
            try:
                robot: int = self._bullet.loadURDF(
                    path, useFixedBase=True, physicsClientId=self._client
                )
            except self._bullet.error as err:
                raise ClearanceError(
                    'robot description: PyBullet cannot load it ({}); are its meshes there?'.format(
                        err
                    )
                ) from err
        return robot

    def _box(self, box: CollisionBox) -> int:
        shape = self._bullet.createCollisionShape(
            self._bullet.GEOM_BOX,
            halfExtents=[side / 2 for side in box.size],
            physicsClientId=self._client,
        )
        world_from_box = self._world_from_base() @ box.base_from_box
        body: int = self._bullet.createMultiBody(
            0,
            shape,
            -1,
            world_from_box[:3, 3].tolist(),
            quaternion(world_from_box).tolist(),
            physicsClientId=self._client,
        )
        return body

    def _world_from_base(self) -> np.ndarray:
        result = np.eye(4)
        if self._base in self._links:
            state = self._bullet.getLinkState(
                self._robot,
                self._links[self._base],
                computeForwardKinematics=True,
                physicsClientId=self._client,
            )
            result[:3, 3] = state[4]
            result[:3, :3] = np.array(self._bullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)
        return result


class ArmClearance:
    """Returns what an arm is nearest to, when called with its joint positions."""

    def __init__(self, model: ClearanceModel, chain: JointChain, within: float) -> None:
        """See ClearanceModel.arm."""
        self._model = model
        self._chain = chain
        self._within = within
        self._moving = model.carried_by(chain.names)
        self._pairs = self._meaningful(model.own_pairs(self._moving))

    def __call__(self, joints: np.ndarray) -> List[Clearance]:
        """The nearest of the robot itself and of the boxes, where near, at joint positions (n,)."""
        self._model.set_joints(dict(zip(self._chain.names, joints)))
        apart = ((self._model.distance(pair, self._within), pair) for pair in self._pairs)
        distance, pair = min(
            (each for each in apart if each[0] > _OVERLAP), default=(float('inf'), (-1, -1))
        )
        found = []
        if distance < self._within:
            found.append(Clearance(distance, self._model.pair_name(pair), False))
        box = self._model.near_boxes(self._moving, self._within)
        if box is not None:
            found.append(Clearance(box[0], box[1], True))
        return found

    def _meaningful(self, pairs: List[Pair]) -> List[Pair]:
        """Pairs of links without those that are near in most postures.

        Those are neighbours, and links that are built together.
        """
        counts = dict.fromkeys(pairs, 0)
        for joints in self._chain.random(np.random.default_rng(0), _SAMPLES):
            self._model.set_joints(dict(zip(self._chain.names, joints)))
            for pair in pairs:
                counts[pair] += self._model.distance(pair, self._within) < self._within
        return [pair for pair in pairs if counts[pair] <= _ALWAYS_NEAR * _SAMPLES]
