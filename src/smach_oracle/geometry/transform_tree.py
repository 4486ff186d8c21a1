"""The transforms along a robot's joints, from its description and the joints' positions."""

from typing import List, Mapping, NamedTuple, Sequence, Tuple, cast

import numpy as np

from .joints import Joint, read_joints
from .transforms import quaternion


class LinkTransform(NamedTuple):
    """The pose of a link in its parent."""

    parent: str
    child: str
    position: Tuple[float, ...]  # x, y, z, m
    turn: Tuple[float, ...]  # quaternion x, y, z, w


class TransformTree:
    """Moving and fixed links of a robot description.

    :param urdf: its text.
    :param measured: joints whose positions are known at any time. The others stay at zero.
    :raises ValueError: for text that is no URDF.
    """

    def __init__(self, urdf: str, measured: Sequence[str]) -> None:
        joints = list(read_joints(urdf).values())
        self.names = [joint.name for joint in joints if joint.moves and joint.name in set(measured)]
        self._moving = [joint for joint in joints if joint.name in self.names]
        self.fixed: List[LinkTransform] = [
            _link(joint, joint.origin[:3, 3], quaternion(joint.origin))
            for joint in joints
            if joint.name not in self.names
        ]
        self._origins = np.array([joint.origin[:3, 3] for joint in self._moving]).reshape(-1, 3)
        self._turns = np.array([quaternion(joint.origin) for joint in self._moving]).reshape(-1, 4)
        self._axes = np.array([joint.axis for joint in self._moving]).reshape(-1, 3)
        self._slides = np.array([not joint.turns for joint in self._moving], bool)
        self._directions = np.array(
            [joint.origin[:3, :3] @ joint.axis for joint in self._moving]
        ).reshape(-1, 3)

    def moving(self, positions: Mapping[str, float]) -> List[LinkTransform]:
        """The links that move, at joint positions (rad or m)."""
        values = np.array([positions[name] for name in self.names])
        places = self._origins + np.where(self._slides, values, 0.0)[:, None] * self._directions
        half = np.where(self._slides, 0.0, values)[:, None] / 2
        turns = _product(self._turns, np.hstack([self._axes * np.sin(half), np.cos(half)]))
        return [
            _link(joint, place, turn) for joint, place, turn in zip(self._moving, places, turns)
        ]


def _link(joint: Joint, place: np.ndarray, turn: np.ndarray) -> LinkTransform:
    return LinkTransform(joint.parent, joint.child, _numbers(place), _numbers(turn))


def _numbers(vector: np.ndarray) -> Tuple[float, ...]:
    # numpy's types may take the list for a text
    return tuple(cast('List[float]', vector.tolist()))


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n, 4) quaternions a times b, x y z w."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    return np.hstack(
        [vector, a[:, 3:] * b[:, 3:] - np.sum(a[:, :3] * b[:, :3], axis=1, keepdims=True)]
    )


def link_transform(parent: str, child: str, matrix: np.ndarray) -> LinkTransform:
    """A link from its 4x4, parent from child."""
    return LinkTransform(parent, child, _numbers(matrix[:3, 3]), _numbers(quaternion(matrix)))
