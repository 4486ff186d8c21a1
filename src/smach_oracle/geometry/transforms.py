"""Rigid transforms as 4x4 arrays: `a_from_b` takes points in frame b to frame a.

Lengths are m. Frames are right-handed (REP 103).
"""

from typing import Sequence, Union

import numpy as np
from scipy.spatial.transform import Rotation

UNTURNED = np.eye(3)
# what is taken for a place or a direction: (3,), or three numbers
VectorLike = Union[Sequence[float], np.ndarray]


def transform(
    position: VectorLike = (0.0, 0.0, 0.0), rotation: np.ndarray = UNTURNED
) -> np.ndarray:
    """4x4 of a position (3,) in m and a rotation matrix (3, 3)."""
    result = np.eye(4)
    result[:3, :3] = rotation
    result[:3, 3] = position
    return result


def from_rpy(
    position: VectorLike, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0
) -> np.ndarray:
    """4x4 of a position (m) and angles about the fixed axes x, y, z (rad), as in URDF."""
    return transform(position, Rotation.from_euler('xyz', [roll, pitch, yaw]).as_matrix())


def from_quaternion(position: VectorLike, xyzw: VectorLike) -> np.ndarray:
    """4x4 of a position (m) and a quaternion (x, y, z, w), which need not have unit length.

    :raises ValueError: for a quaternion of a length that is (next to) zero or beyond all measure,
        or one that is not finite.
    """
    if not np.isfinite(xyzw).all() or not np.isfinite(position).all():
        raise ValueError(
            'pose is not finite: position {}, quaternion {}'.format(list(position), list(xyzw))
        )
    if not 1e-6 <= np.abs(xyzw).max() <= 1e6:
        raise ValueError(
            'quaternion {} is no rotation; allowed: a length of about 1'.format(list(xyzw))
        )
    return transform(position, Rotation.from_quat(xyzw).as_matrix())


def quaternion(matrix: np.ndarray) -> np.ndarray:
    """(x, y, z, w) of the rotation of a 4x4 or 3x3, NaN where that is not finite."""
    if not _is_finite(matrix):
        return np.full(4, np.nan)
    return Rotation.from_matrix(matrix[:3, :3]).as_quat()


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a rigid 4x4."""
    rotation = matrix[:3, :3].T
    return transform(-rotation @ matrix[:3, 3], rotation)


def apply(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (..., 3) in m, taken through a 4x4."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Axis times angle (3,), rad, of the rotation of a 4x4 or 3x3, NaN where that is not finite."""
    if not _is_finite(matrix):
        return np.full(3, np.nan)
    return Rotation.from_matrix(matrix[:3, :3]).as_rotvec()


def _is_finite(matrix: np.ndarray) -> bool:
    """Whether it is a rotation to SciPy, which raises else (1.15 does, 1.10 does not)."""
    return bool(np.isfinite(matrix[:3, :3]).all())


def skew(vector: np.ndarray) -> np.ndarray:
    """(3, 3) that takes a vector to its cross product: `vector` (3,) x it."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """(3, 3): a turn by `angle` rad about an axis (3,) of unit length."""
    cross = skew(axis)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def yaw_of(matrix: np.ndarray) -> float:
    """Heading of the x axis in the xy plane, rad."""
    return float(np.arctan2(matrix[1, 0], matrix[0, 0]))
