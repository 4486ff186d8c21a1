"""A person's other means: the robot's head, its base, its joint states, and time."""

import math
import threading
import time
from collections import OrderedDict
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

import genpy
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from control_msgs.msg import PointHeadAction, PointHeadGoal
from smach_oracle.geometry.transforms import from_quaternion, yaw_of
from smach_oracle.ros.goal_link import GoalLink
from smach_oracle.ros.service_calls import ServerGoneError, call_service
from smach_oracle.srv import (
    ChargeTime,
    ChargeTimeRequest,
    PassTime,
    PassTimeRequest,
    Snapshot,
    SnapshotRequest,
)

from .image_viewer import ImageViewer, ViewError
from .seen_scene import SeenScene

NONE = 'none'
_MOTION_S = 60.0  # wall time that a motion of head or base may take
_STATE_S = 3.0  # wall time in which joint states must come, before they are asked for again
_KEPT = 200  # joint states
_GLANCE_S = 2.0  # of the world's time, that a person takes to look at an image
WHAT = 'expert'  # for which the time passes


class MeansNames(NamedTuple):
    """Names of the robot's parts, as the node's parameters give them."""

    head: str = 'head_traj_controller/point_head_action'
    base: str = 'move_base'
    joint_states: str = 'joint_states'
    odometry: str = 'base_odometry/odom'
    snapshot: str = 'world/snapshot'  # or NONE
    pass_time: str = 'world/pass_time'  # or NONE: ROS time passes by itself
    # or NONE, and where pass_time is NONE: nobody counts a person's time
    charge_time: str = 'world/charge_time'
    camera_frame: str = 'wide_stereo_optical_frame'
    base_frame: str = 'base_footprint'


class RobotMeans:
    """A person's own hand on head and base, and the time that it takes.

    :param grippers: by arm, the joints whose positions add up to the gap between the tips.
    """

    def __init__(
        self, names: MeansNames, grippers: Mapping[str, List[str]], eye: ImageViewer
    ) -> None:
        self._names = names
        self._grippers = grippers
        self._eye = eye
        self._head = GoalLink(rospy.resolve_name(names.head), PointHeadAction)
        self._base = GoalLink(rospy.resolve_name(names.base), MoveBaseAction)
        self._at_work = False
        self._tall: Dict[str, float] = {}  # m, of things that were seen standing
        self._heard = threading.Condition()
        self._states: 'OrderedDict[rospy.Time, Dict[str, float]]' = OrderedDict()
        self._stands: Optional[Odometry] = None
        self._odometry = rospy.Subscriber(
            names.odometry, Odometry, self._keep_odometry, queue_size=100, tcp_nodelay=True
        )
        self._subscriber = rospy.Subscriber(
            names.joint_states, JointState, self._keep, queue_size=100, tcp_nodelay=True
        )

    def look_at(self, point: np.ndarray, *names: str) -> SeenScene:
        """See Watcher.

        :raises ViewError: where nothing can be seen at all.
        """
        self.turn_head(point)
        self.pass_time(_GLANCE_S)
        scene = self._eye.look(*names)
        for name, height in scene.heights().items():  # one that lies was taller before
            self._tall[name] = max(height, self._tall.get(name, 0.0))
        return scene

    def forget(self) -> None:
        """A new trial begins, with other things."""
        self._tall = {}

    def tall(self, name: str) -> Optional[float]:
        """See Watcher."""
        return self._tall.get(name)

    def turn_head(self, point: np.ndarray) -> None:
        """Point the camera at (3,) m, base_footprint. A head that does not obey stays as it is."""
        goal = PointHeadGoal(
            target=PointStamped(Header(frame_id=self._names.base_frame), Point(*map(float, point))),
            pointing_axis=Vector3(0.0, 0.0, 1.0),
            pointing_frame=self._names.camera_frame,
        )
        wrong = _moved(self._head, goal)
        if wrong:
            rospy.logwarn('the head does not turn: %s', wrong)

    def drive(self, x: float, y: float, yaw: float) -> str:
        """Drive the base by so much (m, rad) along its own axes. Return why not, or ''."""
        turn = Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        goal = MoveBaseGoal(
            PoseStamped(Header(frame_id=self._names.base_frame), Pose(Point(x, y, 0.0), turn))
        )
        return _moved(self._base, goal)

    def odom_from_base(self) -> np.ndarray:
        """4x4: where the robot stands by its odometry.

        :raises ViewError: where that does not come.
        """
        stamp = self._snap() or rospy.Time()
        with self._heard:
            if not self._heard.wait_for(lambda: self._stands_at(stamp), _STATE_S):
                raise ViewError('no odometry comes on {}'.format(self._names.odometry))
            stands = self._stands
        if stands is None:
            raise ViewError('no odometry comes on {}'.format(self._names.odometry))
        place, turn = stands.pose.pose.position, stands.pose.pose.orientation
        return from_quaternion((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))

    def stands(self) -> Tuple[float, ...]:
        """Return where the robot stands by its odometry: x and y in m, and its yaw in rad.

        :raises ViewError: where that does not come.
        """
        base = self.odom_from_base()
        return float(base[0, 3]), float(base[1, 3]), yaw_of(base)

    def gap(self, arm: str) -> float:
        """See Watcher.

        :raises ViewError: where no joint states come.
        """
        joints = self._grippers.get(arm, [])
        for _ in range(3):
            state = self._awaited(self._snap())
            if joints and all(name in state for name in joints):
                return float(sum(state[name] for name in joints))
        raise ViewError(
            'no joint states of {} come on {}'.format(
                ', '.join(joints) or arm, self._names.joint_states
            )
        )

    def pass_time(self, seconds: float) -> None:
        """Let a person's time pass: in the world, or by waiting in ROS time."""
        if seconds <= 0:
            return
        if self._names.pass_time == NONE:
            rospy.sleep(seconds)
            return
        try:
            call_service(
                rospy.resolve_name(self._names.pass_time),
                PassTime,
                PassTimeRequest(seconds, WHAT),
                _MOTION_S,
            )
        except (ServerGoneError, rospy.ServiceException) as err:
            raise ViewError('time does not pass: {}'.format(err)) from err

    def begin_work(self) -> None:
        """From now on all of the world's time is the person's.

        :raises ViewError: where the world does not answer.
        """
        if not self._at_work:
            self._charge(True)
            self._at_work = True

    def end_work(self) -> None:
        """The machine goes on from here. It does nothing where the person is not at work.

        :raises ViewError: where the world does not answer.
        """
        if self._at_work:
            self._at_work = False
            self._charge(False)

    def _charge(self, on: bool) -> None:
        if NONE in (self._names.pass_time, self._names.charge_time):
            return
        try:
            call_service(
                rospy.resolve_name(self._names.charge_time),
                ChargeTime,
                ChargeTimeRequest(WHAT, on),
                _MOTION_S,
            )
        except (ServerGoneError, rospy.ServiceException) as err:
            raise ViewError('nobody counts the time: {}'.format(err)) from err

    def _snap(self) -> Optional[rospy.Time]:
        """The stamp of the joint states to wait for. None means the newest."""
        if self._names.snapshot == NONE:
            return None
        try:
            answer = call_service(
                rospy.resolve_name(self._names.snapshot),
                Snapshot,
                SnapshotRequest(camera=False),
                _MOTION_S,
            )
        except ServerGoneError as err:
            raise ViewError(str(err)) from err
        if not answer.ok:
            raise ViewError('{}: {}'.format(self._names.snapshot, answer.message))
        stamp: rospy.Time = answer.stamp
        return stamp

    def _awaited(self, stamp: Optional[rospy.Time]) -> Dict[str, float]:
        """The joint states with a stamp, or {} where they do not come."""
        with self._heard:
            self._heard.wait_for(lambda: self._state_at(stamp), _STATE_S)
            return self._state_at(stamp)

    def _state_at(self, stamp: Optional[rospy.Time]) -> Dict[str, float]:
        if stamp is None:
            return next(reversed(self._states.values()), {})
        return self._states.get(stamp, {})

    def _stands_at(self, stamp: rospy.Time) -> bool:
        return self._stands is not None and bool(self._stands.header.stamp >= stamp)

    def _keep_odometry(self, message: Odometry) -> None:
        with self._heard:
            self._stands = message
            self._heard.notify_all()

    def _keep(self, message: JointState) -> None:
        with self._heard:
            self._states[message.header.stamp] = dict(zip(message.name, message.position))
            while len(self._states) > _KEPT:
                self._states.popitem(last=False)
            self._heard.notify_all()


def _moved(link: GoalLink, goal: genpy.Message) -> str:
    """Send a goal and wait for its end. Return why it was not reached, or ''."""
    if not _within(link.ready):
        return 'no controller at {}'.format(link.name)
    sent = link.send(goal)
    until = time.monotonic() + _MOTION_S
    while time.monotonic() < until and not rospy.is_shutdown():
        event = sent.poll()
        if event is not None and event.status:
            return '' if event.status == GoalStatus.SUCCEEDED else event.text or 'it failed'
    sent.cancel()
    return 'no answer within {:.0f} s'.format(_MOTION_S)


def _within(holds: Callable[[], bool]) -> bool:
    until = time.monotonic() + _MOTION_S / 2
    while not holds():
        if time.monotonic() > until or rospy.is_shutdown():
            return False
        time.sleep(0.02)
    return True
