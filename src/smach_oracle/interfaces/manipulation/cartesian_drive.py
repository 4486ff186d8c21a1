"""From the velocity of a tool to the velocities of the arm's joints, within all limits.

Damped least squares. A limit slows all joints alike, so that the tool keeps its direction and only
gets slower. ROS-free. Lengths in m, angles in rad, times in s. Twists are (6,): linear, then
angular, along the axes of the chain's base, about the tool's origin. The teleoperation of the
paper, section V-A.
"""

from functools import partial
from typing import Callable, List, NamedTuple, Optional, Protocol, Sequence, Tuple

import numpy as np

# m between the finger tips of an open gripper, unless a front end is set otherwise: a PR2's
GRIPPER_OPEN = 0.085
# rad. A joint with less room than this before its limit takes no part in a motion towards it
_ROOM = 1e-4
_EASE_GAIN = 2.0  # 1/s, towards the arm's posture
_EASE_SPEED = 0.8  # rad/s


class ArmKinematics(Protocol):
    """A serial chain, such as geometry.chain.JointChain."""

    names: List[str]  # of the joints
    lower: np.ndarray  # rad, or -inf for continuous joints
    upper: np.ndarray  # rad, or inf for continuous joints
    velocity: np.ndarray  # rad/s, inf where there is none

    def forward(self, joints: np.ndarray) -> np.ndarray:
        """4x4: the chain's base from its tip."""

    def jacobian(self, joints: np.ndarray) -> np.ndarray:
        """(6, n): the tip's twist for unit joint velocities."""


class Clearance(NamedTuple):
    """The nearest thing that the arm could hit."""

    distance: float  # m. Negative where they overlap
    between: str  # what is near what, for people
    # a thing of the world may be touched on purpose, if slowly. The robot's own body may not
    touchable: bool


# from joint positions (n,) to the nearest things, one of a kind at most
ClearanceProbe = Callable[[np.ndarray], Sequence[Clearance]]
# from joint positions (n,), velocities (n,) and a period to the share of the speed that is left and
# the limit that takes the rest
Brake = Callable[[np.ndarray, np.ndarray, float], Tuple[float, str]]


class DriveLimits(NamedTuple):
    """The limits of a motion."""

    linear: float = 0.25  # m/s of the tool
    angular: float = 1.0  # rad/s of the tool
    joint_share: float = 0.5  # of the joints' own velocity limits
    joint_margin: float = 0.02  # rad kept from the joints' position limits
    singular_below: float = 0.06  # singular values of the Jacobian below this are damped
    damping: float = 0.08  # at a singularity
    # share of the twist that may be lost to a joint at its limit. Beyond it, nothing moves
    off_course: float = 0.35
    slow_below: float = 0.08  # m of clearance
    stop_below: float = 0.01  # m of clearance
    creep: float = 0.2  # share of the speed left at `stop_below` towards what may be touched
    # m, corners for the tool
    workspace: Tuple[Tuple[float, ...], Tuple[float, ...]] = ((-1.5,) * 3, (1.5,) * 3)
    posture_gain: float = 0.5  # 1/s, how fast spare joints leave the neighbourhood of their limits


class DriveStep(NamedTuple):
    """One control period."""

    joints: np.ndarray  # (n,) rad, at its end
    velocities: np.ndarray  # (n,) rad/s
    twist: np.ndarray  # (6,) of the tool then
    speed: float  # share of the wanted speed that is left, 0 to 1
    limit: str  # what slowed it, '' where nothing did
    clearance: float  # m, inf where nothing is near


def no_motion() -> DriveStep:
    """The step of an arm that nobody moves."""
    return DriveStep(np.zeros(0), np.zeros(0), np.zeros(6), 1.0, '', float('inf'))


class CartesianDrive:
    """Drives one arm's tool by velocities.

    Stateless: each step starts from the joints that it is given.
    """

    def __init__(
        self,
        arm: ArmKinematics,
        limits: Optional[DriveLimits] = None,
        near: Optional[ClearanceProbe] = None,
        posture: Optional[np.ndarray] = None,
    ) -> None:
        """
        :param near: returns, for joint positions (n,), the nearest things that the arm could hit,
            one of a kind at most.
        :param posture: (n,) rad, to which the arm goes where the tool may turn freely, by default
            the middle of the ranges.
        """
        self.arm = arm
        self.limits = limits or DriveLimits()
        self._near = near
        self._lower = arm.lower + self.limits.joint_margin
        self._upper = arm.upper - self.limits.joint_margin
        finite = np.isfinite(arm.lower) & np.isfinite(arm.upper)
        self._middle = np.where(
            finite, (np.where(finite, arm.lower, 0) + np.where(finite, arm.upper, 0)) / 2, 0.0
        )
        self._posture = posture
        self._half_range = np.where(
            finite, np.where(finite, arm.upper - arm.lower, 1.0) / 2, np.inf
        )

    def step(
        self, joints: np.ndarray, twist: np.ndarray, period: float, turn_freely: bool = False
    ) -> DriveStep:
        """Return where the joints (n,) go within one period for the tool to move by `twist` (6,).

        :param turn_freely: only the linear part counts. Meanwhile, also where it is zero, tool and
            elbow turn as brings the arm to its posture.
        :raises ValueError: for joints, a twist or a period that is not finite or has the wrong
            shape, a period of 0.
        """
        joints, twist = _checked(joints, twist, period, len(self.arm.names))
        if turn_freely:
            twist = np.concatenate([twist[:3], np.zeros(3)])
        nearest = self._near(joints) if self._near is not None else ()
        clearance = min((each.distance for each in nearest), default=float('inf'))
        if not (turn_freely or twist.any()):
            return DriveStep(joints, np.zeros(len(joints)), np.zeros(6), 1.0, '', clearance)
        wanted, limit, share = self._within_tool_limits(twist)
        jacobian = self.arm.jacobian(joints)
        rows = slice(0, 3 if turn_freely else 6)
        velocities, why, rest = self._joint_velocities(joints, jacobian[rows], wanted[rows])
        limit, share = why or limit, share * rest
        brakes: List[Brake] = [
            self._joint_speed,
            self._joint_room,
            self._workspace,
            partial(self._obstacles, nearest),
        ]
        for brake in brakes:
            scale, why = brake(joints, velocities, period)
            if scale < 1.0:
                velocities, limit, share = velocities * scale, why, share * scale
        return DriveStep(
            joints + velocities * period, velocities, jacobian @ velocities, share, limit, clearance
        )

    def _within_tool_limits(self, twist: np.ndarray) -> Tuple[np.ndarray, str, float]:
        scale = min(
            1.0,
            _ratio(self.limits.linear, _length(twist[:3])),
            _ratio(self.limits.angular, _length(twist[3:])),
        )
        return twist * scale, "the tool's speed limit" if scale < 1.0 else '', scale

    def _joint_velocities(
        self, joints: np.ndarray, jacobian: np.ndarray, twist: np.ndarray
    ) -> Tuple[np.ndarray, str, float]:
        """Velocities for the twist. Joints at their limits rest as long as the others can do it.

        :returns: velocities (n,), the limit met or '', and the share of the twist that is left
            along its direction.
        """
        free = np.ones(len(joints), dtype=bool)
        stuck = ''
        while free.any():
            velocities, damped = self._least_squares(joints, jacobian, twist, free)
            blocked = free & (
                ((velocities > 0) & (joints > self._upper - _ROOM))
                | ((velocities < 0) & (joints < self._lower + _ROOM))
            )
            if not blocked.any():
                break
            free &= ~blocked
            stuck = 'joint limit of ' + ', '.join(np.array(self.arm.names)[~free])
        else:
            return np.zeros(len(joints)), stuck, 0.0
        wanted = max(_length(twist), 1e-9)
        lost = _length(jacobian @ velocities - twist) / wanted if twist.any() else 0.0
        if stuck and lost > self.limits.off_course:
            return np.zeros(len(joints)), stuck, 0.0
        along = (
            float(np.clip(jacobian @ velocities @ twist / wanted**2, 0.0, 1.0))
            if twist.any()
            else 1.0
        )
        return velocities, 'singular posture' if damped and lost > 0.02 else '', along

    def _least_squares(
        self, joints: np.ndarray, jacobian: np.ndarray, twist: np.ndarray, free: np.ndarray
    ) -> Tuple[np.ndarray, bool]:
        """Least squares over the free joints, damped in nearly singular directions alone."""
        left, values, right = np.linalg.svd(jacobian[:, free], full_matrices=False)
        nearness = np.clip(1.0 - (values / self.limits.singular_below) ** 2, 0.0, 1.0)
        damping = self.limits.damping**2 * nearness
        solution = right.T @ (values / (values**2 + damping) * (left.T @ twist))
        spare = self._spare(joints, twist)[free]
        solution += spare - right.T @ (right @ spare)
        velocities = np.zeros(len(joints))
        velocities[free] = solution
        return velocities, bool(nearness.any())

    def _spare(self, joints: np.ndarray, twist: np.ndarray) -> np.ndarray:
        """Velocities (n,) for the motion that the tool does not notice.

        They lead away from limits that are near. Where the tool may turn freely, to the arm's
        posture.
        """
        offset = (joints - self._middle) / self._half_range
        if len(twist) == 6:
            effort = min(
                1.0,
                _length(twist[:3]) / self.limits.linear + _length(twist[3:]) / self.limits.angular,
            )
            return (
                -effort
                * self.limits.posture_gain
                * np.sign(offset)
                * np.maximum(np.abs(offset) - 0.6, 0.0)
            )
        away = (
            offset
            if self._posture is None
            else np.arctan2(np.sin(joints - self._posture), np.cos(joints - self._posture))
        )
        return -np.clip(_EASE_GAIN * away, -_EASE_SPEED, _EASE_SPEED)

    def _joint_speed(
        self, joints: np.ndarray, velocities: np.ndarray, period: float
    ) -> Tuple[float, str]:
        shares = np.abs(velocities) / (self.arm.velocity * self.limits.joint_share)
        fastest = int(np.argmax(shares))
        return _ratio(1.0, shares[fastest]), 'speed limit of ' + self.arm.names[fastest]

    def _joint_room(
        self, joints: np.ndarray, velocities: np.ndarray, period: float
    ) -> Tuple[float, str]:
        room = np.where(velocities > 0, self._upper - joints, joints - self._lower)
        way = np.abs(velocities) * period
        shares = np.where(way > 0, np.maximum(room, 0.0) / np.where(way > 0, way, 1.0), np.inf)
        nearest = int(np.argmin(shares))
        return min(1.0, float(shares[nearest])), 'joint limit of ' + self.arm.names[nearest]

    def _workspace(
        self, joints: np.ndarray, velocities: np.ndarray, period: float
    ) -> Tuple[float, str]:
        low, high = (np.array(corner) for corner in self.limits.workspace)
        here = self.arm.forward(joints)[:3, 3]
        way = self.arm.forward(joints + velocities * period)[:3, 3] - here
        room = np.where(way > 0, high - here, here - low)
        shares = np.where(
            np.abs(way) > 1e-9, np.maximum(room, 0.0) / np.maximum(np.abs(way), 1e-9), np.inf
        )
        nearest = int(np.argmin(shares))
        return min(1.0, float(shares[nearest])), 'end of the workspace in ' + 'xyz'[nearest]

    def _obstacles(
        self, now: Sequence[Clearance], joints: np.ndarray, velocities: np.ndarray, period: float
    ) -> Tuple[float, str]:
        near = [each for each in now if each.distance < self.limits.slow_below]
        if self._near is None or not near:
            return 1.0, ''
        then = {each.touchable: each.distance for each in self._near(joints + velocities * period)}
        shares = [
            (self._share_left(each), 'near: ' + each.between)
            for each in near
            if then.get(each.touchable, float('inf')) < each.distance
        ]
        return min(shares, default=(1.0, ''))

    def _share_left(self, near: Clearance) -> float:
        share = (near.distance - self.limits.stop_below) / (
            self.limits.slow_below - self.limits.stop_below
        )
        return float(np.clip(share, self.limits.creep if near.touchable else 0.0, 1.0))


def pulled_back(commanded: np.ndarray, measured: np.ndarray, lead: float) -> np.ndarray:
    """Commanded joint positions (n,), within `lead` rad of the measured ones.

    So pushing at a wall piles up no force. All joints are pulled back alike: each by itself would
    lead the tool away from its course. A joint that is ahead to hold a load gives way, too, as long
    as another one is blocked and the person goes on.
    """
    ahead = commanded - measured
    return measured + ahead * _ratio(lead, float(np.abs(ahead).max()))


def _length(vector: np.ndarray) -> float:
    return float(np.linalg.norm(vector))


def _ratio(limit: float, value: float) -> float:
    return 1.0 if value <= limit else float(limit / value)


def _checked(
    joints: np.ndarray, twist: np.ndarray, period: float, count: int
) -> Tuple[np.ndarray, np.ndarray]:
    joints, twist = np.asarray(joints, dtype=float), np.asarray(twist, dtype=float)
    if joints.shape != (count,) or not np.isfinite(joints).all():
        raise ValueError('joints must be {} finite numbers, not {}'.format(count, joints.tolist()))
    if twist.shape != (6,) or not np.isfinite(twist).all():
        raise ValueError(
            'a twist must be 6 finite numbers (m/s, rad/s), not {}'.format(twist.tolist())
        )
    if not 0.0 < period < float('inf'):
        raise ValueError('a period must be more than 0 s, not {}'.format(period))
    return joints, twist
