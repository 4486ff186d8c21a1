"""The neck with the head camera: where it is by the encoders, and how it is turned to a point."""

import math
from functools import lru_cache
from typing import Sequence

import numpy as np

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import VectorLike, apply, inverse
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import BASE_FRAME, CAMERA_FRAME

NECK: Sequence[str] = ('torso_lift_joint', 'head_pan_joint', 'head_tilt_joint')


@lru_cache(maxsize=1)
def neck() -> JointChain:
    """From base_footprint to the head camera, as the URDF has it. Its joints are NECK."""
    return JointChain.from_urdf(pr2_urdf().read_text(encoding='utf-8'), BASE_FRAME, CAMERA_FRAME)


def head_angles(torso: float, point: VectorLike) -> np.ndarray:
    """Pan and tilt (2,) rad that take the optical axis through a point (3,) of BASE_FRAME.

    :raises ValueError: for a point that is not finite, or at the camera itself.
    """
    if len(point) != 3 or not np.isfinite(point).all():
        raise ValueError('cannot look at {}: not three finite numbers'.format(list(point)))
    where = np.asarray(point, float)

    def miss(angles: np.ndarray) -> np.ndarray:
        seen = apply(inverse(neck().forward(np.concatenate([[torso], angles]))), where)
        return np.array(
            [np.arctan2(seen[0], seen[2]), np.arctan2(seen[1], np.hypot(seen[0], seen[2]))]
        )

    angles = np.array([math.atan2(where[1], where[0]), 0.0])
    for _ in range(20):
        error = miss(angles)
        slope = np.column_stack([(miss(angles + step) - error) / 1e-6 for step in 1e-6 * np.eye(2)])
        angles = angles - np.clip(np.linalg.lstsq(slope, error, rcond=None)[0], -0.5, 0.5)
    if np.abs(miss(angles)).max() > 1e-3:
        raise ValueError('cannot look at {}: it is too near to the head'.format(where.tolist()))
    return (angles + np.pi) % (2 * np.pi) - np.pi
