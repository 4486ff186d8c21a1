"""Where the links of a robot are, from its URDF and its joint positions."""
from typing import Dict, Iterator, List, Mapping

import numpy as np

from .joints import Joint


def link_pose(joints: Dict[str, Joint], root: str, link: str,
              positions: Mapping[str, float]) -> np.ndarray:
    """4x4: `root` from `link`.

    :param joints: as `joints.read_joints` gives them, by the link that each carries.
    :param positions: rad or m by joint; joints that are missing stand at zero.
    :raises ValueError: where `link` does not hang below `root`.
    """
    result = np.eye(4)
    for joint in _upwards(joints, root, link):
        result = joint.origin @ joint.motion(positions.get(joint.name, 0.0)) @ result
    return result


def joints_between(joints: Dict[str, Joint], root: str, link: str) -> List[str]:
    """Names of the joints that move `link` against `root`.

    :param joints: as `joints.read_joints` gives them, by the link that each carries.
    :raises ValueError: where `link` does not hang below `root`.
    """
    return [joint.name for joint in _upwards(joints, root, link) if joint.moves]


def _upwards(joints: Dict[str, Joint], root: str, link: str) -> Iterator[Joint]:
    at = link
    while at != root:
        joint = joints.get(at)
        if joint is None:
            raise ValueError('{!r} is no link below {!r}'.format(link, root))
        yield joint
        at = joint.parent
