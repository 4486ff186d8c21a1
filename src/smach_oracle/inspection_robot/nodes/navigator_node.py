"""Drives to poses in the map: the action `move_base`, and the service `localise`."""

import threading
from typing import Optional, Tuple

import numpy as np
import rospy
import tf2_ros
from actionlib import SimpleActionServer
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, Vector3
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal, MoveBaseResult
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from ..robot.localisation import LocalisationError, Localiser
from ..robot.route import RouteError, RoutePlanner
from ..robot.steering import Steering, WheelCommand
from ..site import START, Pose
from .newest import NewestMessage
from .parameters import ParameterError, number_in, parameters_of
from .transforms import MAP, ODOM, between, joined, pose_message, pose_of, transform

SILENT_S = 10.0  # wall time after which the sensors are taken for dead
STILL = 0.01  # m/s and rad/s: the wheels have stopped
MOTORS_LIMIT_S = 2.0  # that it waits for motors that are off


class DriveError(Exception):
    """The drive has failed. The text says why."""


class Navigator:
    """The node's action and service. It drives by odometry, which `localise` puts right."""

    def __init__(self) -> None:
        """:raises ParameterError: for a parameter that cannot be used."""
        self._blocked_limit_s = number_in('blocked_limit_s', 5.0, 0.5, 600.0)
        self._drive_limit_s = number_in('drive_limit_s', 90.0, 1.0, 3600.0)
        self._planner, self._localiser = RoutePlanner(), Localiser()
        self._odom_in_map: Pose = START
        self._lock = threading.Lock()
        self._odometry = NewestMessage('odom', Odometry)
        self._scan = NewestMessage('scan', LaserScan)
        self._motors = NewestMessage('motors', Bool)
        self._command = rospy.Publisher('cmd_vel', Twist, queue_size=1, tcp_nodelay=True)
        self._frames = tf2_ros.TransformBroadcaster()
        rospy.Subscriber('initialpose', PoseWithCovarianceStamped, self._set_pose, queue_size=1)
        self._service = rospy.Service('localise', Trigger, self._localise)
        self._server = SimpleActionServer('move_base', MoveBaseAction, self._drive, False)
        self._server.start()

    def _set_pose(self, message: PoseWithCovarianceStamped) -> None:
        """Somebody tells where the robot is."""
        odometry = self._odometry.after(rospy.Time.now(), SILENT_S)
        if odometry is not None:
            self._place(pose_of(message.pose.pose), pose_of(odometry.pose.pose))

    def _place(self, pose: Pose, odometry: Pose) -> None:
        with self._lock:
            self._odom_in_map = between(pose, odometry)

    def _pose(self, odometry: Odometry) -> Pose:
        with self._lock:
            return joined(self._odom_in_map, pose_of(odometry.pose.pose))

    def _sensed(self) -> Tuple[Odometry, LaserScan]:
        """Odometry and a scan that come after now.

        :raises DriveError: where they do not come.
        """
        scan = self._scan.after(rospy.Time.now(), SILENT_S)
        odometry = self._odometry.any(SILENT_S)
        if scan is None or odometry is None:
            raise DriveError('no scan or no odometry comes')
        return odometry, scan

    def _localise(self, _: TriggerRequest) -> TriggerResponse:
        """Put the pose right, by a scan at a standstill."""
        try:
            odometry, scan = self._sensed()
            pose = self._localiser.locate(self._pose(odometry), *_rays(scan), scan.range_max)
        except (DriveError, LocalisationError) as err:
            rospy.logwarn('localise: %s', err)
            return TriggerResponse(False, str(err))
        self._place(pose, pose_of(odometry.pose.pose))
        return TriggerResponse(True, '{:.2f}, {:.2f} m, heading {:.2f} rad'.format(*pose))

    def _drive(self, goal: MoveBaseGoal) -> None:
        """Carry out a goal of the action."""
        try:
            self._carry_out(goal)
        except rospy.ROSException:
            if not rospy.is_shutdown():  # else the topics were closed meanwhile
                raise

    def _carry_out(self, goal: MoveBaseGoal) -> None:
        """Drive, stop, and tell how it went."""
        try:
            arrived = self._drive_to(goal.target_pose)
        except (DriveError, RouteError, ValueError) as err:
            self._stop()
            rospy.logwarn('move_base: %s', err)
            self._server.set_aborted(MoveBaseResult(), str(err))
            return
        self._stop()
        if arrived:
            self._server.set_succeeded(MoveBaseResult(), 'arrived')
        else:
            self._server.set_preempted(MoveBaseResult(), 'preempted')

    def _drive_to(self, target: PoseStamped) -> bool:
        """Whether it has arrived. False means it was preempted.

        :raises DriveError: where it does not get there.
        :raises RouteError: where there is no way.
        :raises ValueError: for a goal that is no pose in the map.
        """
        if target.header.frame_id.lstrip('/') != MAP:
            raise ValueError('the goal must be in the frame map')
        goal = pose_of(target.pose)
        steering: Optional[Steering] = None
        begun_s = rospy.get_time()
        moving_s = powered_s = begun_s  # when it was last neither blocked nor without power
        while not (self._server.is_preempt_requested() or rospy.is_shutdown()):
            odometry, scan = self._sensed()
            pose, now_s = self._pose(odometry), rospy.get_time()
            steering = steering or Steering(self._planner.legs(pose, goal), goal[2])
            command = steering.next(pose, *_rays(scan))
            if command.arrived and _stands(odometry):
                return True
            powered_s = now_s if self._is_powered() else powered_s
            moving_s = moving_s if command.blocked else now_s
            self._check(now_s - begun_s, now_s - moving_s, now_s - powered_s)
            self._send(command, pose, scan.header.stamp)
        return False

    def _check(self, driven_s: float, blocked_s: float, unpowered_s: float) -> None:
        """:raises DriveError: where something takes too long."""
        if unpowered_s > MOTORS_LIMIT_S:
            raise DriveError('the motors are off')
        if blocked_s > self._blocked_limit_s:
            raise DriveError('something is in the way for {:.0f} s'.format(blocked_s))
        if driven_s > self._drive_limit_s:
            raise DriveError('not there after {:.0f} s'.format(driven_s))

    def _is_powered(self) -> bool:
        return self._motors.message is None or bool(self._motors.message.data)

    def _send(self, command: WheelCommand, pose: Pose, stamp: rospy.Time) -> None:
        self._command.publish(Twist(Vector3(command.v, 0.0, 0.0), Vector3(0.0, 0.0, command.w)))
        with self._lock:
            self._frames.sendTransform(transform(MAP, ODOM, self._odom_in_map, stamp))
        self._server.publish_feedback(
            MoveBaseFeedback(PoseStamped(Header(stamp=stamp, frame_id=MAP), pose_message(pose)))
        )

    def _stop(self) -> None:
        self._command.publish(Twist())


def _rays(scan: LaserScan) -> Tuple[np.ndarray, np.ndarray]:
    """Its ranges and their angles."""
    ranges = np.asarray(scan.ranges, float)
    return ranges, scan.angle_min + scan.angle_increment * np.arange(len(ranges))


def _stands(odometry: Odometry) -> bool:
    twist = odometry.twist.twist
    return abs(twist.linear.x) < STILL and abs(twist.angular.z) < STILL


def main() -> Optional[int]:
    """Entry point of the node."""
    parameters_of(
        'Node: drives the inspection robot, as the action move_base. '
        'Parameters: ~blocked_limit_s, ~drive_limit_s; see doc/second_robot.md.'
    )
    rospy.init_node('inspection_navigator')
    try:
        navigator = Navigator()
    except ParameterError as err:
        rospy.logfatal('inspection_navigator: %s', err)
        return 2
    rospy.loginfo('%s: ready, %s', rospy.get_name(), type(navigator).__name__)
    rospy.spin()
    return 0
