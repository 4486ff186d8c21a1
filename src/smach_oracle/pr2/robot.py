"""The PR2 as its own subsystems have it: encoders, controllers, a camera, never the truth.

Implemented by RosRobot (the actions and topics of a PR2) and, for unit tests and tuning, by the
world's DirectRobot, which runs in one process. Lengths in m, angles in rad, times in s; frames as
in REP 105 and REP 120.
"""

from typing import Dict, List, NamedTuple, Protocol, Sequence

import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.transforms import VectorLike

from .work_costs import Work

ARMS = ('left', 'right')
ARM_JOINTS: Dict[str, List[str]] = {
    arm: [
        arm[0] + name
        for name in (
            '_shoulder_pan_joint',
            '_shoulder_lift_joint',
            '_upper_arm_roll_joint',
            '_elbow_flex_joint',
            '_forearm_roll_joint',
            '_wrist_flex_joint',
            '_wrist_roll_joint',
        )
    ]
    for arm in ARMS
}
# a finger's position is its travel from its closed place, m: the gap between the tips is their sum
FINGER_JOINTS: Dict[str, List[str]] = {
    arm: ['{}_gripper_{}_finger_joint'.format(arm[0], finger) for finger in 'lr'] for arm in ARMS
}
TOOL_FRAME = {arm: arm[0] + '_gripper_tool_frame' for arm in ARMS}
# on the floor below the middle of the base, the frame subsystems think in
BASE_FRAME = 'base_footprint'
BASE_LINK_HEIGHT = 0.051  # m of base_link above base_footprint
ODOM_FRAME = 'odom_combined'
GOAL_FRAMES = (BASE_FRAME, 'base_link', ODOM_FRAME)  # in which goals may be given
CAMERA_FRAME = 'wide_stereo_optical_frame'
GRIPPER_OPEN = 0.09  # m between the finger tips


class RobotError(Exception):
    """A controller refused or missed a command. The text names it, the command and the outcome."""


class GripperState(NamedTuple):
    """The gap and the force with which a gripper came to rest."""

    position: float  # m between the finger tips
    effort: float  # N
    # it stopped before the position that it was sent to: it holds something, or is blocked
    stalled: bool
    reached: bool


class Robot(Protocol):
    """A PR2, as its encoders and controllers present it. Calls return when the motion has ended."""

    def joints(self) -> Dict[str, float]:
        """Encoder readings of all joints of the URDF that move, now, with everything at rest."""

    def odom_from_base(self) -> np.ndarray:
        """4x4: where the robot believes to stand (ODOM_FRAME from BASE_FRAME)."""

    def localise(self, odom_from_base: np.ndarray) -> None:
        """Put right where the robot believes to stand (4x4), as for amcl's `initialpose`.

        :raises RobotError: where the robot does not take it over.
        """

    def follow(self, joints: Sequence[str], positions: np.ndarray, times: np.ndarray) -> None:
        """Follow a joint trajectory.

        :param positions: (n, len(joints)), the points after the present one.
        :param times: (n,), s from the start, increasing.
        :raises RobotError: where the controller refuses it, or a joint ends or strays too far from
            it.
        """

    def gripper(self, arm: str, position: float, max_effort: float = 50.0) -> GripperState:
        """Open or close a gripper to `position` m between the tips, with at most `max_effort` N.

        :raises RobotError: where it is refused or does not come to its end. To stall at something
            is no error.
        """

    def torso(self, height: float) -> None:
        """Lift the torso joint to `height` m.

        :raises RobotError: where it does not get there.
        """

    def look_at(self, point: VectorLike) -> None:
        """Point the camera's optical axis at a point (3,) of BASE_FRAME.

        :raises RobotError: where the head does not get there.
        """

    def drive(self, odom_from_goal: np.ndarray) -> None:
        """Drive the base to a pose (4x4) in ODOM_FRAME, straight and blindly.

        :raises RobotError: where it ends elsewhere, by its odometry.
        """

    def see(self) -> CameraImage:
        """A fresh image of the head camera.

        :raises RobotError: where none comes.
        """

    def spend(self, what: str, work: Work) -> None:
        """Let the time pass that work takes, where a robot's world waits for that.

        Never raises. Processing an image is spent by see().

        :param what: 'planning' or 'perception'.
        """
