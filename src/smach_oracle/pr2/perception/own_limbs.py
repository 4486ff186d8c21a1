"""The robot's own arms, by its encoders: what the camera sees there is left out."""

from typing import Dict, List, Mapping

import numpy as np

from smach_oracle.geometry.joints import Joint
from smach_oracle.geometry.links import link_pose

from ..robot import ARMS, BASE_FRAME
from .clusters import Capsule

# links at the ends of each part, the radius (m) within which all of it is, and some noise of the
# camera
_PARTS = (
    ('_shoulder_pan_link', '_shoulder_lift_link', 0.2),
    ('_shoulder_lift_link', '_elbow_flex_link', 0.13),
    ('_elbow_flex_link', '_wrist_flex_link', 0.11),
    ('_wrist_flex_link', '_gripper_tool_frame', 0.11),
)


def limbs_of(links: Dict[str, Joint], positions: Mapping[str, float]) -> List[Capsule]:
    """The arms as capsules in the frame of the base.

    :param links: the robot's joints by the link that each carries, from `joints.read_joints`.
    :param positions: encoder readings, rad or m, by joint.
    :raises ValueError: for a robot without a PR2's arms.
    """
    limbs = []
    for arm in ARMS:
        for first, last, radius in _PARTS:
            start, end = (
                link_pose(links, BASE_FRAME, arm[0] + name, positions)[:3, 3]
                for name in (first, last)
            )
            limbs.append(Capsule('{} arm'.format(arm), np.asarray(start), np.asarray(end), radius))
    return limbs
