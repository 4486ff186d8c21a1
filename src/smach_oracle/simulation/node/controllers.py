"""The PR2's controllers: actions whose goals move parts of the robot."""
from functools import partial
from typing import Any, Callable, Dict, Tuple

import actionlib
import rospy
from control_msgs.msg import (FollowJointTrajectoryAction, GripperCommandAction, PointHeadAction,
                              SingleJointPositionAction)
from move_base_msgs.msg import MoveBaseAction
from trajectory_msgs.msg import JointTrajectory

from smach_oracle.simulation.robot.interface import ARM_JOINTS, ARMS, CAMERA_FRAME
from smach_oracle.simulation.world.motions import Drive, Gripper, Head, Torso
from smach_oracle.simulation.world.physics import World
from smach_oracle.simulation.world.trajectory import Motion, Trajectory

from . import feedback, goals
from .loop import WorldLoop
from .motion_table import Ending, MotionTable
from .streamed import Streamed

DEFAULT_EFFORT = 50.0  # N
TORSO_JOINT = 'torso_lift_joint'
CAMERA_FRAMES = (CAMERA_FRAME, 'high_def_optical_frame', 'head_plate_frame')
NEWER = 'a newer command took its place'


class Controller:
    """An action for one part of the robot. All but the two callbacks run in the world's thread.

    :param make: the motion of a goal; raises ValueError where it can be none, and the goal is rejected.
    :param report: (motion, ending) to the action's result.
    :param feed: a motion to the action's feedback.
    """

    def __init__(self, name: str, spec: Any, part: str, loop: WorldLoop, motions: MotionTable,
                 make: Callable[[Any], Motion], report: Callable[[Motion, Ending], Any],
                 feed: Callable[[Motion], Any]) -> None:
        self._part = part
        self._motions = motions
        self._make, self._report, self._feed = make, report, feed
        self._refusal = type(spec().action_result.result)
        self._handle: Any = None
        self._server = actionlib.ActionServer(
            name, spec, lambda handle: loop.tell(partial(self._begin, handle)),
            lambda handle: loop.tell(partial(self._cancel, handle)), auto_start=False)
        self._server.start()

    def _begin(self, handle: Any) -> None:
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

    def _cancel(self, handle: Any) -> None:
        if self._handle is not None and handle == self._handle:  # else it has ended since it was cancelled
            self._motions.stop(self._part, 'preempted')

    def _end(self, handle: Any, motion: Motion, ending: Ending) -> None:
        self._handle = None
        result = self._report(motion, ending)
        if ending.result is not None and ending.result.ok:
            handle.set_succeeded(result, ending.text)
        elif ending.result is not None or ending.aborted:
            handle.set_aborted(result, ending.text)
        else:
            handle.set_canceled(result, ending.text)

    def publish_feedback(self) -> None:
        """Tell who commanded the motion that is under way how it goes."""
        if self._handle is not None:
            self._handle.publish_feedback(self._feed(self._motions.motion(self._part)))


class Controllers:
    """All of them, and the topics on which joint targets for the arms come in a stream.

    :param streamed: called in the world's thread when a target of a stream has been reached, or was refused.
    """

    def __init__(self, world: World, loop: WorldLoop, motions: MotionTable, now_s: Callable[[], float],
                 streamed: Callable[[], Any]) -> None:
        self._world, self._loop, self._motions, self._now_s = world, loop, motions, now_s
        self._streamed = streamed
        self._limits: Dict[str, Dict[str, Tuple[float, float]]] = {
            arm: {name: world.robot.limits[name] for name in ARM_JOINTS[arm]} for arm in ARMS}
        self._all = [self._one('head_traj_controller/point_head_action', PointHeadAction, 'head', self._head,
                               feedback.head_result, feedback.head),
                     self._one('torso_controller/position_joint_action', SingleJointPositionAction, 'torso',
                               self._torso, feedback.torso_result, feedback.torso),
                     self._one('move_base', MoveBaseAction, 'base', self._base, feedback.base_result, feedback.base)]
        for arm in ARMS:
            self._add_arm(arm)

    def _add_arm(self, arm: str) -> None:
        side = arm[0]
        self._all.append(self._one(side + '_arm_controller/follow_joint_trajectory', FollowJointTrajectoryAction,
                                   arm + '_arm', partial(self._arm, arm), feedback.arm_result, feedback.arm))
        self._all.append(self._one(side + '_gripper_controller/gripper_action', GripperCommandAction,
                                   arm + '_gripper', partial(self._gripper, arm),
                                   partial(feedback.gripper_result, arm), partial(feedback.gripper, arm)))
        rospy.Subscriber(side + '_arm_controller/command', JointTrajectory,
                         lambda message: self._loop.tell(partial(self._stream, arm, message)),
                         queue_size=10, tcp_nodelay=True)

    def _one(self, name: str, spec: Any, part: str, make: Any, report: Any, feed: Any) -> Controller:
        return Controller(name, spec, part, self._loop, self._motions, make, partial(report, self._world),
                          partial(feed, self._world))

    def publish_feedback(self) -> None:
        """Of every motion that is under way."""
        for controller in self._all:
            controller.publish_feedback()

    def _head(self, goal: Any) -> Motion:
        goals.check_axis(goal.pointing_axis, goal.pointing_frame, CAMERA_FRAMES)
        return Head(self._world, goals.point_in_base(goal.target, self._world.odom_from_base()))

    def _torso(self, goal: Any) -> Motion:
        return Torso(self._world, goals.height_of(goal.position, self._world.robot.limits[TORSO_JOINT]))

    def _base(self, goal: Any) -> Motion:
        return Drive(goals.odom_from_pose(goal.target_pose, self._world.odom_from_base()))

    def _gripper(self, arm: str, goal: Any) -> Motion:
        return Gripper(arm, *goals.gap_of(goal.command.position, goal.command.max_effort, DEFAULT_EFFORT))

    def _arm(self, arm: str, goal: Any) -> Motion:
        course = goals.course_of(goal, self._limits[arm], self._now_s())
        motion = Trajectory(course.joints, course.positions, course.times, course.velocities,
                            tolerances=course.tolerances)
        wrong = motion.refusal(self._world)
        if wrong:
            raise goals.BadGoal(wrong)
        return motion

    def _stream(self, arm: str, message: JointTrajectory) -> None:
        part = arm + '_arm'
        if not message.points:
            self._motions.stop(part, NEWER)  # a PR2's controllers take an empty trajectory for a stop
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
            motion = Streamed(dict(zip(joints, positions[0].tolist())), float(times[0]))
        self._motions.start(part, motion, lambda ending: self._streamed(), NEWER)

    def streaming(self) -> bool:
        """Whether a target of a stream is on its way."""
        return any(isinstance(self._motions.motion(arm + '_arm'), Streamed) for arm in ARMS)
