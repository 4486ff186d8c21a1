"""The PR2 behind its actions and topics: what the subsystems' nodes drive, simulated or real."""

import math
import threading
import time
from typing import Dict, List, Optional, Sequence

import genpy
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import (
    Point,
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Vector3,
)
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandGoal,
    PointHeadAction,
    PointHeadGoal,
    SingleJointPositionAction,
    SingleJointPositionGoal,
)
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.transforms import VectorLike, quaternion
from smach_oracle.ros.goal_link import GoalEvent, GoalLink, SentGoal, lost

from .pose_teller import AGAIN_S, TOLD_S, PoseTeller, told
from .robot import ARM_JOINTS, ARMS, BASE_FRAME, CAMERA_FRAME, ODOM_FRAME, GripperState, RobotError
from .ros_senses import RosSenses
from .ros_time import WorldTime
from .work_costs import Work

NO_SNAPSHOT = 'none'
NO_PASS_TIME = 'none'
# wall s in which a gripper that closes has closed. A PR2's gripper_action answers a cancel with the
# present gap and no effort: what the hand holds would fall.
CLOSING_S = 2.0
CONNECTED_S = 60.0  # wall s that a simulated robot may take to be there


class RosRobot:
    """The Robot protocol over ROS.

    All names are relative to the node's namespace, and can be remapped.

    :param snapshot: service smach_oracle/Snapshot of a simulated world, which gives joint states,
        transforms and images with one stamp; NO_SNAPSHOT: whatever comes next, as on a real robot.
    :param pass_time: service smach_oracle/PassTime of a simulated world, to which the time is
        charged that planning and perception take. NO_PASS_TIME, or no such service: nothing is.
    :param timeout_s: wall s that the robot may be silent, or not there, before a call fails.
    """

    def __init__(
        self,
        snapshot: str = 'world/snapshot',
        timeout_s: float = 30.0,
        pass_time: str = 'world/pass_time',
    ) -> None:
        self._timeout_s = timeout_s
        self._simulated = snapshot != NO_SNAPSHOT
        self._senses = RosSenses('' if snapshot == NO_SNAPSHOT else snapshot, timeout_s)
        self._time = WorldTime('' if pass_time == NO_PASS_TIME else pass_time)
        self._links: Dict[str, GoalLink] = {}
        for side in (arm[0] for arm in ARMS):
            self._link(
                side + '_arm_controller/follow_joint_trajectory', FollowJointTrajectoryAction
            )
            self._link(side + '_gripper_controller/gripper_action', GripperCommandAction)
        self._link('head_traj_controller/point_head_action', PointHeadAction)
        self._link('torso_controller/position_joint_action', SingleJointPositionAction)
        self._link('move_base', MoveBaseAction)
        self._localisation = PoseTeller()
        self._aborted = threading.Event()
        self._calls = threading.RLock()

    def _link(self, name: str, spec: type) -> None:
        self._links[name] = GoalLink(rospy.resolve_name(name), spec)

    def wait_until_connected(self, limit_s: float = CONNECTED_S) -> List[str]:
        """Wait until everything of a simulated robot is connected, both ways.

        :param limit_s: wall s that it waits at most.
        :returns: names of what is not there; [] too where the robot gives no snapshots: of a real
            one some parts may be missing for good.
        """
        until = time.monotonic() + limit_s
        lacking = self._lacking()
        while lacking and time.monotonic() < until and not rospy.is_shutdown():
            time.sleep(0.05)
            lacking = self._lacking()
        return lacking

    def _lacking(self) -> List[str]:
        if not self._simulated:
            return []
        return self._senses.lacking() + [
            link.name for link in self._links.values() if not link.ready()
        ]

    def abort(self) -> None:
        """Stop what moves now, and refuse all further calls until resume(), from any thread.

        Calls raise RobotError meanwhile.
        """
        self._aborted.set()

    def resume(self) -> None:
        """Take calls again after abort()."""
        self._aborted.clear()

    def joints(self) -> Dict[str, float]:
        """See Robot.

        :raises RobotError: where no joint states come.
        """
        self._check_allowed()
        return self._senses.joints()

    def odom_from_base(self) -> np.ndarray:
        """See Robot.

        :raises RobotError: where no transform comes.
        """
        self._check_allowed()
        return self._senses.transform(ODOM_FRAME, BASE_FRAME)

    def localise(self, odom_from_base: np.ndarray) -> None:
        """See Robot."""
        until = time.monotonic() + self._timeout_s
        tell_at = 0.0
        while True:
            if time.monotonic() >= tell_at and self._localisation.has_listener():
                self._localisation.tell(odom_from_base)
                tell_at = time.monotonic() + AGAIN_S
            time.sleep(TOLD_S)
            if told(odom_from_base, self.odom_from_base()):
                return
            if time.monotonic() > until or rospy.is_shutdown():
                raise RobotError(
                    'the robot did not take over where it stands: nobody listens to '
                    '{}, or it moves'.format(self._localisation.name)
                )

    def see(self) -> CameraImage:
        """See Robot."""
        self._check_allowed()
        image = self._senses.see(BASE_FRAME, CAMERA_FRAME)
        self.spend('perception', Work(images=1))
        return image

    def spend(self, what: str, work: Work) -> None:
        """See Robot. Nothing is charged to a robot that was told to stop."""
        if not self._aborted.is_set():
            self._time.spend(work.seconds, what)

    def follow(self, joints: Sequence[str], positions: np.ndarray, times: np.ndarray) -> None:
        """See Robot. All of the joints belong to one arm.

        :raises RobotError: for other joints, for shapes that do not fit, and where the controller
            refuses or fails.
        """
        arm = next((arm for arm in ARMS if set(joints) <= set(ARM_JOINTS[arm])), '')
        if not arm or not len(joints):
            raise RobotError(
                'follow: joints {}; allowed: those of one arm, {}'.format(
                    list(joints), ' or '.join(', '.join(ARM_JOINTS[each]) for each in ARMS)
                )
            )
        shape = np.shape(positions)
        if shape != (len(times), len(joints)):
            raise RobotError(
                'follow: positions {} do not fit {} times and {} joints'.format(
                    shape, len(times), len(joints)
                )
            )
        points = [
            JointTrajectoryPoint(
                positions=list(map(float, point)), time_from_start=_duration(moment)
            )
            for point, moment in zip(positions, times)
        ]
        goal = FollowJointTrajectoryGoal(
            trajectory=JointTrajectory(joint_names=list(joints), points=points)
        )
        result = self._do(arm[0] + '_arm_controller/follow_joint_trajectory', goal, arm + ' arm')
        if result.error_code != FollowJointTrajectoryResult.SUCCESSFUL:
            raise RobotError(
                '{} arm: error {} {}'.format(arm, result.error_code, result.error_string)
            )

    def gripper(self, arm: str, position: float, max_effort: float = 50.0) -> GripperState:
        """See Robot. A gripper that stalls has not failed.

        :raises RobotError: where it did not carry out the command.
        """
        if arm not in ARMS:
            raise RobotError('unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))
        goal = GripperCommandGoal()
        goal.command.position, goal.command.max_effort = float(position), float(max_effort)
        result = self._do(
            arm[0] + '_gripper_controller/gripper_action',
            goal,
            arm + ' gripper',
            stalls=True,
            ends_within_s=0.0 if position > 0 else CLOSING_S,
        )
        return GripperState(result.position, result.effort, result.stalled, result.reached_goal)

    def torso(self, height: float) -> None:
        """See Robot."""
        self._do(
            'torso_controller/position_joint_action',
            SingleJointPositionGoal(position=float(height)),
            'torso',
        )

    def look_at(self, point: VectorLike) -> None:
        """See Robot."""
        target = PointStamped(Header(frame_id=BASE_FRAME), Point(*map(float, point)))
        goal = PointHeadGoal(
            target=target, pointing_axis=Vector3(0.0, 0.0, 1.0), pointing_frame=CAMERA_FRAME
        )
        self._do('head_traj_controller/point_head_action', goal, 'head')

    def drive(self, odom_from_goal: np.ndarray) -> None:
        """See Robot.

        :raises RobotError: also for a goal that is not a finite 4x4.
        """
        if np.shape(odom_from_goal) != (4, 4) or not np.isfinite(odom_from_goal).all():
            raise RobotError('drive: the goal is no finite 4x4 pose')
        target = PoseStamped(Header(frame_id=ODOM_FRAME), _pose_of(odom_from_goal))
        self._do('move_base', MoveBaseGoal(target), 'base')

    def _do(
        self,
        name: str,
        goal: genpy.Message,
        what: str,
        stalls: bool = False,
        ends_within_s: float = 0.0,
    ) -> genpy.Message:
        """Send a goal and wait for its result.

        :param stalls: a goal that was aborted still has a result (a gripper that holds
            something).
        :param ends_within_s: wall s for which abort() lets it go on.
        :raises RobotError: where no controller takes it, it fails, or abort() is called.
        """
        with self._calls:
            link = self._ready(name, what)
            sent = link.send(goal)
            cancelled_at: Optional[float] = None
            until = time.monotonic() + ends_within_s
            while True:
                event = sent.poll()
                if event is not None and event.status:
                    return self._result(event, what, stalls)
                self._check(link, sent, what)
                now = time.monotonic()
                if not self._aborted.is_set():
                    until = now + ends_within_s
                elif cancelled_at is None and now >= until:
                    cancelled_at = now
                    sent.cancel()
                if cancelled_at is not None and now - cancelled_at > self._timeout_s:
                    raise RobotError('{}: stopping it got no answer'.format(what))

    def _ready(self, name: str, what: str) -> GoalLink:
        link = self._links[name]
        until = time.monotonic() + self._timeout_s
        self._check_allowed()
        while not link.ready():
            if time.monotonic() > until or rospy.is_shutdown():
                raise RobotError('{}: no controller at {}'.format(what, link.name))
            time.sleep(0.01)
            self._check_allowed()
        return link

    def _check_allowed(self) -> None:
        if self._aborted.is_set():
            raise RobotError('the robot was told to stop')

    @staticmethod
    def _check(link: GoalLink, sent: SentGoal, what: str) -> None:
        if rospy.is_shutdown():
            raise RobotError('{}: this node is shutting down'.format(what))
        if not link.alive() or sent.unheard(time.monotonic()):
            raise RobotError('{}: the controller at {} has gone'.format(what, link.name))

    @staticmethod
    def _result(event: GoalEvent, what: str, stalls: bool) -> genpy.Message:
        ended_well = event.status == GoalStatus.SUCCEEDED or (
            stalls and event.status == GoalStatus.ABORTED
        )
        if ended_well and event.result is not None:
            return event.result
        if lost(event):
            raise RobotError('{}: the controller was restarted'.format(what))
        text = event.text or getattr(event.result, 'error_string', '')
        raise RobotError(
            '{}: {}{}'.format(
                what,
                {
                    GoalStatus.REJECTED: 'rejected',
                    GoalStatus.PREEMPTED: 'preempted',
                    GoalStatus.RECALLED: 'preempted',
                }.get(event.status, 'failed'),
                ': ' + text if text else '',
            )
        )


def _pose_of(pose: np.ndarray) -> Pose:
    """A 4x4 as a message."""
    return Pose(Point(*pose[:3, 3].tolist()), Quaternion(*quaternion(pose).tolist()))


def _duration(seconds: float) -> rospy.Duration:
    if not math.isfinite(seconds):
        raise RobotError('follow: a time is {}; allowed: finite numbers'.format(seconds))
    return rospy.Duration.from_sec(float(seconds))
