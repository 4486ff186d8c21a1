"""Conditions that must hold before the robot does something: functions for the oracle's settings.

Each takes a machine's userdata, which it does not read, and listens to the robot's topics. Those
that check look at one message. Those that wait return once the check holds, or after a while.
"""

import time
from typing import Any, Callable

import numpy as np
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, LaserScan
from std_msgs.msg import Bool

COMES_S = 5.0  # wall time that a message may take
POLL_S = 0.02
STILL = 0.01  # m/s and rad/s
STOPS_S = 3.0  # ROS time, as those below
MOTORS_COME_BACK_S = 20.0
WALKS_ON_S = 15.0
LIGHT_MOVES_S = 20.0
WAY = (0.8, 0.35)  # m before the robot, and to either side, in which nothing stands
VIEW = (1.1, 0.3)  # the same, between the camera and the panel
TOO_BRIGHT = 250  # a pixel that is white as light
MOST_LIT = 0.03  # share of the image


def motors_are_on(userdata: Any) -> bool:
    """Whether the base has power."""
    return _holds('motors', Bool, _are_on, 0.0)


def wait_for_motors(userdata: Any) -> bool:
    """Wait until the base has power."""
    return _holds('motors', Bool, _are_on, MOTORS_COME_BACK_S)


def way_is_free(userdata: Any) -> bool:
    """Whether nothing stands right before the robot."""
    return _holds('scan', LaserScan, _has_way, 0.0)


def wait_for_way(userdata: Any) -> bool:
    """Wait until whoever stands before the robot walks on."""
    return _holds('scan', LaserScan, _has_way, WALKS_ON_S)


def stands_still(userdata: Any) -> bool:
    """Whether the wheels stand, or come to stand within a moment."""
    return _holds('odom', Odometry, _is_still, STOPS_S)


def view_is_free(userdata: Any) -> bool:
    """Whether nobody stands between the robot and the panel."""
    return _holds('scan', LaserScan, _has_view, 0.0)


def wait_for_view(userdata: Any) -> bool:
    """Wait until nobody stands there any more."""
    return _holds('scan', LaserScan, _has_view, WALKS_ON_S)


def light_is_fair(userdata: Any) -> bool:
    """Whether no light falls into the camera."""
    return _holds('camera/image_raw', Image, _is_fair, 0.0)


def wait_for_light(userdata: Any) -> bool:
    """Wait until the light has moved on."""
    return _holds('camera/image_raw', Image, _is_fair, LIGHT_MOVES_S)


def _are_on(message: Bool) -> bool:
    return bool(message.data)


def _is_still(message: Odometry) -> bool:
    twist = message.twist.twist
    return abs(twist.linear.x) < STILL and abs(twist.angular.z) < STILL


def _has_way(message: LaserScan) -> bool:
    return _is_free(message, *WAY)


def _has_view(message: LaserScan) -> bool:
    return _is_free(message, *VIEW)


def _is_free(scan: LaserScan, ahead: float, aside: float) -> bool:
    """Whether a scan has no point on a strip before the robot (m)."""
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    x, y = scan.ranges * np.cos(angles), scan.ranges * np.sin(angles)
    return not bool(((x > 0) & (x < ahead) & (np.abs(y) < aside)).any())


def _is_fair(image: Image) -> bool:
    pixels = np.frombuffer(image.data, np.uint8).reshape(-1, 3)
    return float((pixels.min(axis=1) > TOO_BRIGHT).mean()) < MOST_LIT


def _holds(topic: str, spec: type, condition: Callable[[Any], bool], limit_s: float) -> bool:
    """Whether a topic's newest message meets a condition within so much ROS time (s)."""
    seen: list = []
    subscriber = rospy.Subscriber(topic, spec, seen.append, queue_size=1, buff_size=1 << 21)
    try:
        until_s = rospy.get_time() + limit_s
        comes_until_s = time.monotonic() + COMES_S
        while not rospy.is_shutdown():
            if seen and condition(seen[-1]):
                return True
            waits = rospy.get_time() < until_s if seen else time.monotonic() < comes_until_s
            if not waits:
                return False
            del seen[:-1]
            time.sleep(POLL_S)  # wall time: a simulation that stands must not hang it
        return False
    finally:
        subscriber.unregister()
