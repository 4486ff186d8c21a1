"""One arm that a person drives: commands in, one control period of motion out."""

from typing import Callable, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist, Vector3
from std_msgs.msg import Header

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.joints import read_joints
from smach_oracle.geometry.links import joints_between, link_pose
from smach_oracle.geometry.transforms import quaternion
from smach_oracle.msg import TeleopCommand

from .arm_port import ArmNames, ArmPort, GripperPort, JointListener
from .cartesian_drive import (
    CartesianDrive,
    ClearanceProbe,
    DriveLimits,
    DriveStep,
    no_motion,
    pulled_back,
)

_SILENT_S = 1.0  # wall time after which joints without a message are not known any more
_REST_LEAD = 0.05  # rad by which targets may stay ahead of the joints when nobody moves the arm


class DescribedRobot(NamedTuple):
    """The description of the robot that all arms share."""

    urdf: str
    base: str  # frame of poses, and of commands that are not in another one
    listener: JointListener


class TeleoperatedArm:
    """One arm. Only one thread may move it."""

    def __init__(
        self, robot: DescribedRobot, names: ArmNames, limits: DriveLimits, lead: float
    ) -> None:
        """`lead`: rad by which the targets may be ahead of the measured joints.

        :raises ValueError: where the arm's links are not in the robot description.
        """
        self._robot = robot
        self._names = names
        self._tree = read_joints(robot.urdf)
        self.chain = JointChain.from_urdf(robot.urdf, names.base, names.tool)
        self._limits = limits
        if len(names.posture) not in (0, len(self.chain.names)):
            raise ValueError(
                'posture of {}: {} angles for {} joints'.format(
                    names.tool, len(names.posture), len(self.chain.names)
                )
            )
        self._drive = self._driven(None)
        self._port = ArmPort(names.command, self.chain.names)
        self.gripper = GripperPort(names.gripper)
        self._lead = lead
        self._targets: Optional[np.ndarray] = None
        # of the tool, when the gripper last closed on something
        self.grasp: Optional[PoseStamped] = None
        link_pose(self._tree, robot.base, names.tool, {})

    def watch(self, near: ClearanceProbe) -> None:
        """Slow down near the things that `near` returns."""
        self._drive = self._driven(near)

    def _driven(self, near: Optional[ClearanceProbe]) -> CartesianDrive:
        posture = np.array(self._names.posture) if self._names.posture else None
        return CartesianDrive(self.chain, self._limits, near, posture)

    def forget(self) -> None:
        """A new goal begins: forget what was grasped for another one."""
        self.grasp = None

    def begin(self) -> None:
        """A person takes hold: targets start from where the arm is measured to be."""
        self._targets = None

    def rest(self, period_s: float) -> None:
        """The person has let go: an arm that could not follow its targets stops pushing."""
        targets, self._targets = self._targets, None
        if targets is not None and not self._unknown((), False):
            near = pulled_back(targets, self.measured(self._robot.listener.now()[0]), _REST_LEAD)
            if (near != targets).any():
                self._port.send(near, np.zeros(len(near)), period_s)

    def why_not(self, command: TeleopCommand, frozen: bool) -> str:
        """Return why the command cannot be carried out, or ''.

        :param frozen: whether the world stands still, and publishes nothing, between two commands.
        """
        twist = _array(command.twist)
        if not np.isfinite(twist).all():
            return 'twist {} is not finite'.format(twist.tolist())
        if command.move_gripper and not (
            0.0 <= command.gripper < np.inf and 0.0 <= command.gripper_effort < np.inf
        ):
            return 'gripper {} m with {} N: both must be finite and 0 or more'.format(
                command.gripper, command.gripper_effort
            )
        try:
            needed = joints_between(self._tree, self._robot.base, command.header.frame_id)
        except ValueError as err:
            return 'frame {!r}: {}; allowed: {}, {} or another link of the robot'.format(
                command.header.frame_id, err, self._names.tool, self._robot.base
            )
        return (
            self._unknown(needed, frozen)
            or self._port.why_not()
            or (self.gripper.why_not() if command.move_gripper else '')
        )

    def _unknown(self, more: Sequence[str], frozen: bool) -> str:
        """Return why positions of the arm's joints, or of `more`, are unknown, '' if known."""
        needed = joints_between(self._tree, self._robot.base, self._names.tool)[::-1]
        needed += [name for name in more if name not in needed]
        positions, _ = self._robot.listener.now()
        missing = [name for name in needed if name not in positions]
        if missing:
            return 'no joint_states of {} yet'.format(', '.join(missing))
        odd = [name for name in needed if not np.isfinite(positions[name])]
        if odd:
            return 'joint_states of {} are not finite'.format(', '.join(odd))
        silent_s = self._robot.listener.silent_s(needed)
        return (
            ''
            if frozen or silent_s < _SILENT_S
            else 'no joint_states for {:.1f} s'.format(silent_s)
        )

    def move(self, command: TeleopCommand, period_s: float, held: Callable[[], bool]) -> DriveStep:
        """Send the joints where the tool is one period later, if it moves as commanded.

        :param held: whether the dead-man still is, asked right before.
        """
        positions, _ = self._robot.listener.now()
        measured = self.measured(positions)
        targets = (
            measured if self._targets is None else pulled_back(self._targets, measured, self._lead)
        )
        twist = _array(command.twist)
        axes = self._axes(self._names.base, positions).T @ self._axes(
            command.header.frame_id, positions
        )
        step = self._drive.step(
            targets,
            np.concatenate([axes @ twist[:3], axes @ twist[3:]]),
            period_s,
            command.turn_freely,
        )
        if not held():
            return no_motion()
        if step.velocities.any():
            self._port.send(step.joints, step.velocities, period_s)
        self._targets = step.joints
        return step

    def move_and_wait(
        self, command: TeleopCommand, period_s: float, limit_s: float
    ) -> Tuple[DriveStep, bool]:
        """Move in lock-step with a world that stands still between commands.

        :returns: the step, and whether the world has carried it out.
        """
        positions, since = self._robot.listener.now()
        before = {name: positions[name] for name in self.chain.names}
        step = self.move(command, period_s, lambda: True)
        if not step.velocities.any():  # time passes, too
            self._port.send(step.joints, step.velocities, period_s)
        moved = before if step.velocities.any() else None
        return step, self._robot.listener.wait_for_period(moved, since, period_s, limit_s)

    def catch_up(self, stamp: rospy.Time, limit_s: float) -> bool:
        """Wait until the joints of `stamp` or later are known. Return whether they are."""
        return self._robot.listener.catch_up(stamp, limit_s)

    def measured(self, positions: Mapping[str, float]) -> np.ndarray:
        """(n,) rad, of this arm's joints."""
        return np.array([positions[name] for name in self.chain.names])

    def tool_pose(self) -> PoseStamped:
        """Return the pose of the tool now, in the robot's base frame."""
        positions, stamp = self._robot.listener.now()
        pose = link_pose(self._tree, self._robot.base, self._names.tool, positions)
        return PoseStamped(
            Header(frame_id=self._robot.base, stamp=stamp),
            Pose(Point(*pose[:3, 3]), Quaternion(*quaternion(pose))),
        )

    def in_base(self, twist: np.ndarray) -> Twist:
        """A twist (6,), m/s and rad/s, from the axes of the arm's base to those of the robot's."""
        axes = self._axes(self._names.base, self._robot.listener.now()[0])
        return Twist(Vector3(*(axes @ twist[:3])), Vector3(*(axes @ twist[3:])))

    def note_gripper(self) -> None:
        """The gripper's motion has ended: if it holds something, this is how it was grasped."""
        if self.gripper.report.stalled:
            self.grasp = self.tool_pose()

    def _axes(self, frame: str, positions: Mapping[str, float]) -> np.ndarray:
        """(3, 3): rotation of the robot's base frame from `frame`."""
        return link_pose(self._tree, self._robot.base, frame, positions)[:3, :3]


def _array(twist: Twist) -> np.ndarray:
    return np.array(
        [
            twist.linear.x,
            twist.linear.y,
            twist.linear.z,
            twist.angular.x,
            twist.angular.y,
            twist.angular.z,
        ]
    )
