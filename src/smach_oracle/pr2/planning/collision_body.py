"""The robot loaded for collision checks, in a PyBullet client that is kept from skill to skill.

To load the robot takes as long as some hundred checks. So a client that a skill is done with is
cleaned and lent again. A cleaned one answers as a new one does: it stands at zero, and no contact
of before is left in it.
"""

import os
import tempfile
import threading
import xml.etree.ElementTree as ElementTree
from typing import FrozenSet, List, Mapping, NamedTuple, Set, Tuple

import pybullet

from smach_oracle.geometry.joints import read_joints

from ..model.pr2_model import pr2_urdf, srdf_pairs
from ..robot import ARM_JOINTS

KEPT = 2  # idle clients, at most
_FLAGS = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_SELF_COLLISION
_MOVING, _RESTING = 1, 64  # collision groups. 1 is what PyBullet gives to all that moves
_ALL = -1  # mask: meets every group


class CollisionModel(NamedTuple):
    """The robot's body as collision checks need it."""

    urdf: str  # XML text with absolute names of mesh files
    allowed: FrozenSet[FrozenSet[str]]  # pairs of links that may touch


def installed_model() -> CollisionModel:
    """The PR2 as derived from the installed description.

    :raises ModelError: where there is none.
    """
    return CollisionModel(pr2_urdf().read_text(), srdf_pairs())


def model_from(urdf: str, srdf: str) -> CollisionModel:
    """A model out of robot_description and robot_description_semantic.

    :raises ValueError: for text that is not XML.
    """
    read_joints(urdf)
    try:
        pairs = ElementTree.fromstring(srdf).iter('disable_collisions')
    except ElementTree.ParseError as err:
        raise ValueError('robot_description_semantic: {}'.format(err)) from err
    return CollisionModel(
        urdf, frozenset(frozenset((pair.get('link1', ''), pair.get('link2', ''))) for pair in pairs)
    )


class CollisionBody:
    """The robot in a client of its own. The pairs of links that may touch are left out."""

    def __init__(self, model: CollisionModel, arm: str) -> None:
        """Load it.

        :param arm: the arm that moves, 'left' or 'right'.
        :raises ValueError: for a description that cannot be loaded.
        """
        self.client: int = pybullet.connect(pybullet.DIRECT)
        try:
            self.robot = self._load(model.urdf)
            infos = [
                pybullet.getJointInfo(self.robot, k, physicsClientId=self.client)
                for k in range(pybullet.getNumJoints(self.robot, physicsClientId=self.client))
            ]
            self.links = {info[12].decode(): k for k, info in enumerate(infos)}
            self.joints = {info[1].decode(): k for k, info in enumerate(infos)}
            self.arm = [self.joints[name] for name in ARM_JOINTS[arm]]
            names = _below(model.urdf, arm[0] + '_shoulder_pan_link')
            self.moving = {self.links[name] for name in names}
            self.hand = {self.links[name] for name in names if '_gripper_' in name}
            self._solid = [
                (name, index)
                for name, index in self.links.items()
                if pybullet.getCollisionShapeData(self.robot, index, physicsClientId=self.client)
            ]
            # of links that must not touch, one of which moves
            self.pairs = self._filter(model.allowed)
            self.clean()
        except Exception:
            self.close()
            raise

    def place(self, joints: Mapping[str, float]) -> None:
        """Set joints to positions (rad or m). Names that it does not have are left out."""
        known = [
            (self.joints[name], value)
            for name, value in sorted(joints.items())
            if name in self.joints
        ]
        pybullet.resetJointStatesMultiDof(
            self.robot,
            [index for index, _ in known],
            [[value] for _, value in known],
            physicsClientId=self.client,
        )

    def clean(self) -> None:
        """Put every joint to zero, and drop what the client remembers of earlier contacts.

        Only the robot may be in it. Contacts are dropped with the links' entries in the
        broadphase, which come back in the order in which they are made here.
        """
        self.place(dict.fromkeys(self.joints, 0.0))
        for resting in (False, True):  # these meet what moves, not each other, nor the boxes
            for _, index in self._solid:
                if (index not in self.moving) == resting:
                    group, mask = (_RESTING, _MOVING) if resting else (_MOVING, _ALL)
                    pybullet.setCollisionFilterGroupMask(
                        self.robot, index, group, mask, physicsClientId=self.client
                    )

    def close(self) -> None:
        """Drop the client. The object cannot be used afterwards."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def _load(self, urdf: str) -> int:
        """PyBullet reads robots from files only."""
        handle, path = tempfile.mkstemp(suffix='.urdf')
        try:
            with os.fdopen(handle, 'w') as stream:
                stream.write(urdf)
            return int(
                pybullet.loadURDF(
                    path, useFixedBase=True, flags=_FLAGS, physicsClientId=self.client
                )
            )
        except pybullet.error as err:
            raise ValueError('robot description: {}'.format(err)) from err
        finally:
            os.remove(path)

    def _filter(self, allowed: FrozenSet[FrozenSet[str]]) -> List[Tuple[int, int]]:
        """Leave on the pairs with a moving link that must not touch. They are returned."""
        moving = [each for each in self._solid if each[1] in self.moving]
        resting = [each for each in self._solid if each[1] not in self.moving]
        pairs = []
        for k, (one, first) in enumerate(moving):
            for other, second in moving[k + 1 :] + resting:
                if frozenset((one, other)) not in allowed:
                    pairs.append((first, second))
                else:
                    pybullet.setCollisionFilterPair(
                        self.robot, self.robot, first, second, 0, physicsClientId=self.client
                    )
        return pairs


class BodyPool:
    """Clients that are lent and given back. Any thread may use it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: List[Tuple[CollisionModel, str, CollisionBody]] = []

    def lend(self, model: CollisionModel, arm: str) -> CollisionBody:
        """A robot as `CollisionBody` loads it, with every joint at zero.

        :raises ValueError: for a description that cannot be loaded.
        """
        with self._lock:
            for number, (made_of, made_for, body) in enumerate(self._idle):
                if made_for == arm and made_of == model:
                    del self._idle[number]
                    return body
        return CollisionBody(model, arm)

    def take_back(self, model: CollisionModel, arm: str, body: CollisionBody) -> None:
        """Take back one in which nothing but the robot is left. The oldest is dropped."""
        body.clean()
        with self._lock:
            self._idle.append((model, arm, body))
            dropped = self._idle[:-KEPT]
            del self._idle[:-KEPT]
        for _, _, old in dropped:
            old.close()


def _below(urdf: str, link: str) -> Set[str]:
    """A link and all that hang on it."""
    joints = read_joints(urdf).values()
    found = {link}
    while True:
        more = {joint.child for joint in joints if joint.parent in found} - found
        if not more:
            return found
        found |= more
