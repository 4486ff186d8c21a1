"""The PR2's controllers: actions whose goals move parts of the robot."""

from functools import partial
from typing import Callable, Dict, Optional, Tuple

import actionlib
import genpy
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from trajectory_msgs.msg import JointTrajectory

from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    GripperCommandAction,
    GripperCommandGoal,
    PointHeadAction,
    PointHeadGoal,
    SingleJointPositionAction,
    SingleJointPositionGoal,
)
from smach_oracle.pr2.robot import ARM_JOINTS, ARMS, CAMERA_FRAME

from ..physics.motions import BaseMotion, GripperMotion, HeadMotion, TorsoMotion
from ..physics.trajectory import Motion, Trajectory
from ..physics.world import World
from . import feedback, goals
from .loop import WorldLoop
from .motion_table import MotionEnd, MotionTable
from .streamed_target import StreamedTarget

DEFAULT_EFFORT = 50.0  # N
TORSO_JOINT = 'torso_lift_joint'
CAMERA_FRAMES = (CAMERA_FRAME, 'high_def_optical_frame', 'head_plate_frame')
NEWER = 'a newer command took its place'

MakeMotion = Callable[[genpy.Message], Motion]  # of a goal
MakeMessage = Callable[..., genpy.Message]  # of a motion, and for a result of its end


class Controller:
    """An action for one part of the robot.

    All but the two callbacks run in the world's thread.

    :param make: the motion of a goal. A ValueError from it rejects the goal.
    :param report: (motion, end) to the action's result.
    :param feed: a motion to the action's feedback.
    """

    def __init__(
        self,
        name: str,
        spec: type,
        part: str,
        loop: WorldLoop,
        motions: MotionTable,
        make: MakeMotion,
        report: MakeMessage,
        feed: MakeMessage,
    ) -> None:
        self._part = part
        self._motions = motions
        self._make, self._report, self._feed = make, report, feed
        self._refusal = type(spec().action_result.result)
        self._handle: Optional[actionlib.ServerGoalHandle] = None
        self._server = actionlib.ActionServer(
            name,
            spec,
            lambda handle: loop.post(partial(self._begin, handle)),
            lambda handle: loop.post(partial(self._cancel, handle)),
            auto_start=False,
        )
        self._server.start()

    def _begin(self, handle: actionlib.ServerGoalHandle) -> None:
        try:
            motion = self._make(handle.get_goal())
        except ValueError as err:
            result = self._refusal()
            if isinstance(err, goals.BadGoal) and hasattr(result, 'error_code'):
                result.error_code, result.error_string = err.code, str(err)
            rospy.logwarn('%s: goal rejected: %s', self._part, err)
            handle.set_rejected(result, str(err))
            return
        handle.set_accepted()
        self._motions.start(self._part, motion, partial(self._end, handle, motion), NEWER)
        self._handle = handle

    def _cancel(self, handle: actionlib.ServerGoalHandle) -> None:
        # else it has ended since it was cancelled
        if self._handle is not None and handle == self._handle:
            self._motions.stop(self._part, 'preempted')

    def _end(self, handle: actionlib.ServerGoalHandle, motion: Motion, end: MotionEnd) -> None:
        self._handle = None
        result = self._report(motion, end)
        if end.result is not None and end.result.ok:
            handle.set_succeeded(result, end.text)
        elif end.result is not None or end.aborted:
            handle.set_aborted(result, end.text)
        else:
            handle.set_canceled(result, end.text)

    def publish_feedback(self) -> None:
        """Publish how far the motion under way is."""
        if self._handle is not None:
            self._handle.publish_feedback(self._feed(self._motions.motion(self._part)))


class Controllers:
    """All controllers, and the topics on which joint targets for the arms come in a stream.

    :param streamed: called in the world's thread when a target of a stream has been reached, or was
        refused.
    """

    def __init__(
        self,
        world: World,
        loop: WorldLoop,
        motions: MotionTable,
        now_s: Callable[[], float],
        streamed: Callable[[], object],
    ) -> None:
        self._world, self._loop, self._motions, self._now_s = world, loop, motions, now_s
        self._streamed = streamed
        self._limits: Dict[str, Dict[str, Tuple[float, float]]] = {
            arm: {name: world.robot.limits[name] for name in ARM_JOINTS[arm]} for arm in ARMS
        }
        self._all = [
            self._one(
                'head_traj_controller/point_head_action',
                PointHeadAction,
                'head',
                self._head,
                feedback.head_result,
                feedback.head,
            ),
            self._one(
                'torso_controller/position_joint_action',
                SingleJointPositionAction,
                'torso',
                self._torso,
                feedback.torso_result,
                feedback.torso,
            ),
            self._one(
                'move_base', MoveBaseAction, 'base', self._base, feedback.base_result, feedback.base
            ),
        ]
        for arm in ARMS:
            self._add_arm(arm)
        rospy.Subscriber(
            'initialpose',
            PoseWithCovarianceStamped,
            lambda message: self._loop.post(partial(self._localise, message)),
            queue_size=2,
            tcp_nodelay=True,
        )

    def _add_arm(self, arm: str) -> None:
        side = arm[0]
        self._all.append(
            self._one(
                side + '_arm_controller/follow_joint_trajectory',
                FollowJointTrajectoryAction,
                arm + '_arm',
                partial(self._arm, arm),
                feedback.arm_result,
                feedback.arm,
            )
        )
        self._all.append(
            self._one(
                side + '_gripper_controller/gripper_action',
                GripperCommandAction,
                arm + '_gripper',
                partial(self._gripper, arm),
                partial(feedback.gripper_result, arm),
                partial(feedback.gripper, arm),
            )
        )
        rospy.Subscriber(
            side + '_arm_controller/command',
            JointTrajectory,
            lambda message: self._loop.post(partial(self._stream, arm, message)),
            queue_size=10,
            tcp_nodelay=True,
        )

    def _one(
        self,
        name: str,
        spec: type,
        part: str,
        make: MakeMotion,
        report: MakeMessage,
        feed: MakeMessage,
    ) -> Controller:
        return Controller(
            name,
            spec,
            part,
            self._loop,
            self._motions,
            make,
            partial(report, self._world),
            partial(feed, self._world),
        )

    def publish_feedback(self) -> None:
        """Publish the feedback of every motion that is under way."""
        for controller in self._all:
            controller.publish_feedback()

    def _head(self, goal: PointHeadGoal) -> Motion:
        goals.check_axis(goal.pointing_axis, goal.pointing_frame, CAMERA_FRAMES)
        return HeadMotion(
            self._world, goals.point_in_base(goal.target, self._world.odom_from_base())
        )

    def _torso(self, goal: SingleJointPositionGoal) -> Motion:
        return TorsoMotion(
            self._world, goals.height_of(goal.position, self._world.robot.limits[TORSO_JOINT])
        )

    def _base(self, goal: MoveBaseGoal) -> Motion:
        return BaseMotion(goals.odom_from_pose(goal.target_pose, self._world.odom_from_base()))

    def _gripper(self, arm: str, goal: GripperCommandGoal) -> Motion:
        return GripperMotion(
            arm, *goals.gap_of(goal.command.position, goal.command.max_effort, DEFAULT_EFFORT)
        )

    def _arm(self, arm: str, goal: FollowJointTrajectoryGoal) -> Motion:
        checked = goals.checked_trajectory(goal, self._limits[arm], self._now_s())
        motion = Trajectory(
            checked.joints,
            checked.positions,
            checked.times,
            checked.velocities,
            tolerances=checked.tolerances,
        )
        wrong = motion.refusal(self._world)
        if wrong:
            raise goals.BadGoal(wrong)
        return motion

    def _stream(self, arm: str, message: JointTrajectory) -> None:
        part = arm + '_arm'
        if not message.points:
            # a PR2's controllers take an empty trajectory for a stop
            self._motions.stop(part, NEWER)
            return
        try:
            joints, positions, times = goals.points_of_trajectory(message, self._limits[arm])
        except goals.BadGoal as err:
            rospy.logwarn_throttle(2.0, '{}: command refused: {}'.format(part, err))
            self._streamed()
            return
        if len(times) > 1:
            motion: Motion = Trajectory(joints, positions, times)
        else:
            motion = StreamedTarget(dict(zip(joints, map(float, positions[0]))), float(times[0]))
        self._motions.start(part, motion, lambda end: self._streamed(), NEWER)

    def _localise(self, message: PoseWithCovarianceStamped) -> None:
        """Take over where the robot stands, as amcl does from this topic."""
        pose = PoseStamped(message.header, message.pose.pose)
        try:
            self._world.localise(goals.odom_from_pose(pose, self._world.odom_from_base()))
        except goals.BadGoal as err:
            rospy.logwarn('initialpose: refused: %s', err)
        self._streamed()

    def streaming(self) -> bool:
        """Whether a target of a stream is on its way."""
        return any(isinstance(self._motions.motion(arm + '_arm'), StreamedTarget) for arm in ARMS)
