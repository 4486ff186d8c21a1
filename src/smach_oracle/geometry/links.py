"""Where the links of a robot are, from its URDF and its joint positions."""
from typing import Dict, Iterator, List, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from .chain import Joint
from .transforms import transform

_MOVING = ('prismatic', 'revolute', 'continuous')


def link_pose(joints: Dict[str, Joint], root: str, link: str, positions: Mapping[str, float]) -> np.ndarray:
    """4x4: `root` from `link`.

    :param joints: as `chain.read_joints` gives them, by the link that each carries.
    :param positions: rad or m by joint; joints that are missing stand at zero.
    :raises ValueError: where `link` does not hang below `root`.
    """
    result = np.eye(4)
    for joint in _upwards(joints, root, link):
        result = joint.origin @ motion_of(joint, positions.get(joint.name, 0.0)) @ result
    return result


def joints_between(joints: Dict[str, Joint], root: str, link: str) -> List[str]:
    """Names of the joints that move `link` against `root`.

    :param joints: as `chain.read_joints` gives them, by the link that each carries.
    :raises ValueError: where `link` does not hang below `root`.
    """
    return [joint.name for joint in _upwards(joints, root, link) if joint.kind in _MOVING]


def _upwards(joints: Dict[str, Joint], root: str, link: str) -> Iterator[Joint]:
    at = link
    while at != root:
        joint = joints.get(at)
        if joint is None:
            raise ValueError('{!r} is no link below {!r}'.format(link, root))
        yield joint
        at = joint.parent


def motion_of(joint: Joint, position: float) -> np.ndarray:
    """4x4: the joint's frame at zero from that at a position (rad or m)."""
    if joint.kind == 'prismatic':
        return transform(joint.axis * position)
    if joint.kind in _MOVING:
        return transform(rotation=Rotation.from_rotvec(joint.axis * position).as_matrix())
    return np.eye(4)
