"""A serial chain of joints: its forward and inverse kinematics.

For example:

    arm = JointChain.from_urdf(text, 'base_footprint', 'r_gripper_tool_frame',
                               fixed={'torso_lift_joint': 0.2})
    tool = arm.forward(q)  # 4x4, root from tip
    q = arm.inverse(tool, seed, np.random.default_rng(1))  # None where no solution was found
"""

from typing import List, Mapping, Optional, Tuple

import numpy as np

from .joints import Joint, moved, placed_parts, read_joints
from .links import joints_down
from .transforms import rotation_vector

POSITION_TOLERANCE = 1e-3  # m
ANGLE_TOLERANCE = 5e-3  # rad


class JointChain:
    """The n moving joints between two links, in order from the root.

    Their positions are rad, or m where they slide. A joint that mimics another counts as one that
    moves by itself. Many configurations are computed at a time here, as the inverse needs them:
    links.py has the walk along the links for one.
    """

    def __init__(self, joints: List[Joint], fixed: Mapping[str, float]) -> None:
        """See from_urdf. `joints` are all of those between root and tip, with the fixed ones."""
        moving: List[Tuple[np.ndarray, Joint]] = []
        before = np.eye(4)
        for joint in joints:
            before = before @ joint.origin
            if joint.moves and joint.name not in fixed:
                moving.append((before, joint))
                before = np.eye(4)
            elif joint.moves:
                before = before @ joint.motion(fixed[joint.name])
        self._tip = before
        self.joints = [joint for _, joint in moving]
        self.names = [joint.name for joint in self.joints]
        self.lower = np.array([joint.lower for joint in self.joints])
        self.upper = np.array([joint.upper for joint in self.joints])
        self.velocity = np.array([joint.velocity for joint in self.joints])
        self.continuous = np.array(
            [joint.kind == 'continuous' for joint in self.joints], dtype=bool
        )
        self._turning = np.array([joint.turns for joint in self.joints], dtype=bool)
        self._axes = np.array([joint.axis for joint in self.joints])
        self._parts = placed_parts(self.joints, [place for place, _ in moving])

    @classmethod
    def from_urdf(
        cls, urdf: str, root: str, tip: str, fixed: Optional[Mapping[str, float]] = None
    ) -> 'JointChain':
        """The chain between two links of a robot description (XML text).

        :param fixed: joints on the way that must not move, with their positions (rad or m).
        :raises ValueError: where the text is no URDF, a link or a fixed joint is not there, `tip`
            does not hang below `root`, or no joint between them moves.
        """
        by_child = read_joints(urdf)
        links = set(by_child) | {joint.parent for joint in by_child.values()}
        for link in (root, tip):
            if link not in links:
                raise ValueError('robot description: no link {!r}'.format(link))
        joints = joints_down(by_child, root, tip)
        unknown = sorted(set(fixed or {}) - {joint.name for joint in joints})
        if unknown:
            raise ValueError(
                'no joint {} between {!r} and {!r}'.format(', '.join(unknown), root, tip)
            )
        if not any(joint.moves and joint.name not in (fixed or {}) for joint in joints):
            raise ValueError('no joint moves between {!r} and {!r}'.format(root, tip))
        return cls(joints, fixed or {})

    def forward(self, q: np.ndarray) -> np.ndarray:
        """4x4, root from tip, at joint positions (n,)."""
        return self._frames(np.asarray(q, dtype=float)[None])[1][0]

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """(6, n): the tip's velocity for each joint's, linear then angular, in the root's axes."""
        return self._jacobians(*self._frames(np.asarray(q, dtype=float)[None]))[0]

    def clip(self, q: np.ndarray) -> np.ndarray:
        """The joint positions within the limits that are nearest to `q`, (n,) or (m, n)."""
        return np.clip(q, self.lower, self.upper)

    def nearest_turn(self, q: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """`q` with its continuous joints within half a turn of `reference`.

        :param q: (n,) or (m, n).
        :param reference: (n,).
        """
        turned = reference + (q - reference + np.pi) % (2 * np.pi) - np.pi
        return np.where(self.continuous, turned, q)

    def random(self, generator: np.random.Generator, count: int) -> np.ndarray:
        """(count, n) joint positions, uniform within the limits.

        Continuous joints are drawn within a turn.
        """
        lower = np.where(self.continuous, -np.pi, self.lower)
        upper = np.where(self.continuous, np.pi, self.upper)
        return generator.uniform(lower, upper, (count, len(self.names)))

    def inverse(
        self,
        pose: np.ndarray,
        seed: np.ndarray,
        generator: Optional[np.random.Generator] = None,
        restarts: int = 15,
        iterations: int = 50,
    ) -> Optional[np.ndarray]:
        """Joint positions that take the tip to `pose`, within the limits.

        :param pose: 4x4, root from tip, reached to 1 mm and 0.3 degrees.
        :param seed: (n,), where to start. Continuous joints end within half a turn of it.
        :param generator: draws further starts, tried at the same time. None means the seed alone,
            so that the solution is the one next to it.
        :returns: (n,), the solution found first (the one nearest to the seed, where several were),
            or None where there was none.
        :raises ValueError: for a pose or seed that is not finite.
        """
        found = self._solve(pose, seed, generator, restarts, iterations, first=True)
        return found[0] if len(found) else None

    def solutions(
        self,
        pose: np.ndarray,
        seed: np.ndarray,
        generator: np.random.Generator,
        restarts: int = 15,
        iterations: int = 50,
    ) -> np.ndarray:
        """All solutions found from the seed and the restarts, nearest to the seed first.

        Parameters are as for inverse().

        :returns: (m, n).
        :raises ValueError: for a pose or seed that is not finite.
        """
        return self._solve(pose, seed, generator, restarts, iterations, first=False)

    def inverses(self, poses: np.ndarray, seed: np.ndarray, iterations: int = 50) -> np.ndarray:
        """Return for each pose the solution next to the seed, all tried at the same time.

        :param poses: (k, 4, 4), root from tip.
        :param seed: (n,), as for inverse().
        :returns: (k, n), with NaN where there was no solution.
        :raises ValueError: for a pose or seed that is not finite.
        """
        seed = np.asarray(seed, dtype=float)
        _check_finite(poses, seed)
        found = np.full((len(poses), len(seed)), np.nan)
        left, q = np.arange(len(poses)), np.repeat(self.clip(seed)[None], len(poses), axis=0)
        for _ in range(iterations):
            frames, tips = self._frames(q)
            error = _error(poses[left], tips)
            done = _is_there(error)
            found[left[done]] = q[done]
            if done.all():
                break
            left, q, frames, tips, error = (each[~done] for each in (left, q, frames, tips, error))
            q = self.clip(q + _step(self._jacobians(frames, tips), error))
        return self.nearest_turn(found, seed)

    def _solve(
        self,
        pose: np.ndarray,
        seed: np.ndarray,
        generator: Optional[np.random.Generator],
        restarts: int,
        iterations: int,
        first: bool,
    ) -> np.ndarray:
        seed = np.asarray(seed, dtype=float)
        _check_finite(pose, seed)
        starts = self.clip(seed)[None]
        if generator is not None:
            starts = np.concatenate([starts, self.random(generator, restarts)])
        solved = self._descend(pose, starts, iterations, first)
        solved = self.nearest_turn(solved, seed)
        order = np.argsort(np.abs(solved - seed).max(axis=1), kind='stable')
        return solved[order]

    def _descend(self, pose: np.ndarray, q: np.ndarray, iterations: int, first: bool) -> np.ndarray:
        """Levenberg-Marquardt from all starts (k, n) at once, those that arrived (m, n)."""
        arrived: List[np.ndarray] = []
        for _ in range(iterations):
            frames, tips = self._frames(q)
            error = _error(pose, tips)
            done = _is_there(error)
            if done.any():
                arrived.append(q[done])
                if first or done.all():
                    break
                q, frames, tips, error = q[~done], frames[~done], tips[~done], error[~done]
            q = self.clip(q + _step(self._jacobians(frames, tips), error))
        return np.concatenate(arrived) if arrived else np.zeros((0, len(self.names)))

    def _frames(self, q: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Frames of the joints after their motion (k, n, 4, 4), and of the tip (k, 4, 4).

        :param q: (k, n).
        """
        local = moved(self._parts, self._turning, q)
        frames = np.empty_like(local)
        frames[:, 0] = local[:, 0]
        for k in range(1, len(self.names)):
            np.matmul(frames[:, k - 1], local[:, k], out=frames[:, k])
        return frames, frames[:, -1] @ self._tip

    def _jacobians(self, frames: np.ndarray, tips: np.ndarray) -> np.ndarray:
        """(k, 6, n), from _frames()."""
        axes = np.einsum('knij,nj->kni', frames[..., :3, :3], self._axes)
        turning = self._turning[:, None]
        linear = np.where(turning, _cross(axes, tips[:, None, :3, 3] - frames[..., :3, 3]), axes)
        return np.concatenate([linear, np.where(turning, axes, 0.0)], axis=2).transpose(0, 2, 1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products over the last axis. Most of np.cross's time goes into its checks."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def _check_finite(poses: np.ndarray, seed: np.ndarray) -> None:
    if not (np.isfinite(poses).all() and np.isfinite(seed).all()):
        raise ValueError('inverse kinematics: the pose or the seed is not finite')


def _is_there(error: np.ndarray) -> np.ndarray:
    """(k,) whether a tip is where it should be. `error` as _error() has it."""
    there: np.ndarray = (np.linalg.norm(error[:, :3], axis=1) < POSITION_TOLERANCE) & (
        np.linalg.norm(error[:, 3:], axis=1) < ANGLE_TOLERANCE
    )
    return there


def _error(pose: np.ndarray, tips: np.ndarray) -> np.ndarray:
    """(k, 6): way and turn (rotation vector) from each tip to the pose.

    :param pose: 4x4, or (k, 4, 4): one for each.
    """
    turn = pose[..., :3, :3] @ tips[:, :3, :3].transpose(0, 2, 1)
    vector = 0.5 * np.stack(
        [
            turn[:, 2, 1] - turn[:, 1, 2],
            turn[:, 0, 2] - turn[:, 2, 0],
            turn[:, 1, 0] - turn[:, 0, 1],
        ],
        axis=1,
    )
    sine = np.linalg.norm(vector, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(turn, axis1=1, axis2=2) - 1.0))
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    vector = scale[:, None] * vector
    # half a turn: its axis is not in the skew part
    for k in np.flatnonzero((sine <= 1e-9) & (angle > 1.0)):
        vector[k] = rotation_vector(turn[k])
    return np.concatenate([pose[..., :3, 3] - tips[:, :3, 3], vector], axis=1)


def _step(jacobians: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(k, n): a step of damped least squares.

    The error is clipped, so that a far goal does not make a wild step.
    """
    error = error.copy()
    far = np.linalg.norm(error[:, :3], axis=1, keepdims=True)
    error[:, :3] *= np.minimum(1.0, 0.2 / np.maximum(far, 1e-9))
    error[:, 3:] = np.clip(error[:, 3:], -0.5, 0.5)
    damping = 0.0025 * np.minimum(1.0, np.linalg.norm(error, axis=1))
    transposed = jacobians.transpose(0, 2, 1)
    normal = jacobians @ transposed + damping[:, None, None] * np.eye(6)
    return (transposed @ np.linalg.solve(normal, error[..., None]))[..., 0]
