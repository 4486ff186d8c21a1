"""The poses of a robot's links, from its URDF and its joint positions."""

from typing import Dict, List, Mapping, Sequence

import numpy as np

from .joints import Joint


def link_poses(
    joints: Sequence[Joint], root: str, positions: Mapping[str, float]
) -> Dict[str, np.ndarray]:
    """4x4 by link: `root` from it.

    :param joints: below `root`, every link's after that of the link that it hangs on.
    :param positions: rad or m by joint. Joints that are missing go with those that they mimic, or
        stand at zero.
    """
    poses = {root: np.eye(4)}
    for joint in joints:
        motion = joint.motion(joint.position(positions))
        poses[joint.child] = poses[joint.parent] @ joint.origin @ motion
    return poses


def link_pose(
    joints: Mapping[str, Joint], root: str, link: str, positions: Mapping[str, float]
) -> np.ndarray:
    """4x4: `root` from `link`.

    :param joints: as `joints.read_joints` gives them, by the link that each carries.
    :param positions: as for `link_poses`.
    :raises ValueError: where `link` does not hang below `root`.
    """
    return link_poses(joints_down(joints, root, link), root, positions)[link]


def joints_between(joints: Mapping[str, Joint], root: str, link: str) -> List[str]:
    """Names of the joints that move `link` against `root`, from the root outwards.

    :param joints: as `joints.read_joints` gives them, by the link that each carries.
    :raises ValueError: where `link` does not hang below `root`.
    """
    return [joint.name for joint in joints_down(joints, root, link) if joint.moves]


def joints_down(joints: Mapping[str, Joint], root: str, link: str) -> List[Joint]:
    """All joints on the way from `root` to `link`, in this order. Fixed ones are among them.

    :param joints: as `joints.read_joints` gives them, by the link that each carries.
    :raises ValueError: where `link` does not hang below `root`.
    """
    way: List[Joint] = []
    at = link
    while at != root:
        joint = joints.get(at)
        if joint is None or len(way) > len(joints):  # a circle of links has no end
            raise ValueError('robot description: {!r} does not hang below {!r}'.format(link, root))
        way.append(joint)
        at = joint.parent
    return way[::-1]
