"""The topics that the robot's hardware publishes."""

from typing import Optional

import numpy as np
import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Transform,
    TransformStamped,
    TwistWithCovariance,
    Vector3,
)
from geometry_msgs.msg import Twist as TwistMessage
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, CameraInfo, Image, LaserScan
from std_msgs.msg import Bool, Header

from ..site import CAMERA_HEIGHT, START
from ..world.inspection_world import BEAMS, SCANNER_RANGE, InspectionWorld
from ..world.view import HEIGHT, WIDTH, intrinsics
from .transforms import BASE, CAMERA, MAP, ODOM, pose_message, transform

LOOKS_FORWARD = Quaternion(-0.5, 0.5, -0.5, 0.5)  # of an optical frame: z ahead, x to the right
DIAGNOSTICS_S = 1.0  # between two
OF_THE_BASE = 'base: motors and battery'


class HardwareTopics:
    """Publishes a world's state as odometry, scan, image, motors, battery and diagnostics."""

    def __init__(self) -> None:
        self._odometry = rospy.Publisher('odom', Odometry, queue_size=2)
        self._scan = rospy.Publisher('scan', LaserScan, queue_size=2, tcp_nodelay=True)
        self._image = rospy.Publisher('camera/image_raw', Image, queue_size=1)
        self._info = rospy.Publisher('camera/camera_info', CameraInfo, queue_size=1)
        self._motors = rospy.Publisher('motors', Bool, queue_size=2, latch=True)
        self._battery = rospy.Publisher('battery', BatteryState, queue_size=2)
        self._diagnostics = rospy.Publisher('/diagnostics', DiagnosticArray, queue_size=2)
        self._start = rospy.Publisher(
            'initialpose', PoseWithCovarianceStamped, queue_size=2, latch=True
        )
        self._frames = tf2_ros.TransformBroadcaster()
        self._fixed = tf2_ros.StaticTransformBroadcaster()
        self._fixed.sendTransform(
            TransformStamped(
                Header(frame_id=BASE),
                CAMERA,
                Transform(Vector3(0.0, 0.0, CAMERA_HEIGHT), LOOKS_FORWARD),
            )
        )
        self._told_motors: Optional[bool] = None
        self._diagnostics_due = rospy.Time()
        self.publish_start()

    def publish_start(self) -> None:
        """Tell where the robot has been set down, as a person does who sets it down."""
        self._start.publish(
            PoseWithCovarianceStamped(
                Header(frame_id=MAP), PoseWithCovariance(pose=pose_message(START))
            )
        )

    def publish_state(self, world: InspectionWorld, scan: np.ndarray, now: rospy.Time) -> None:
        """Publish everything but the image."""
        base = world.base
        twist = TwistMessage(Vector3(base.wheels.v, 0.0, 0.0), Vector3(0.0, 0.0, base.wheels.w))
        self._odometry.publish(
            Odometry(
                Header(stamp=now, frame_id=ODOM),
                BASE,
                PoseWithCovariance(pose=pose_message(base.odometry)),
                TwistWithCovariance(twist=twist),
            )
        )
        self._frames.sendTransform(transform(ODOM, BASE, base.odometry, now))
        self._scan.publish(
            LaserScan(
                header=Header(stamp=now, frame_id=BASE),
                angle_min=BEAMS[0],
                angle_max=BEAMS[-1],
                angle_increment=BEAMS[1] - BEAMS[0],
                range_min=0.0,
                range_max=SCANNER_RANGE,
                ranges=scan.tolist(),
            )
        )
        if base.powered != self._told_motors:
            self._told_motors = base.powered
            self._motors.publish(Bool(base.powered))
        if now >= self._diagnostics_due:
            self._diagnostics_due = now + rospy.Duration(DIAGNOSTICS_S)
            self._publish_health(world, now)

    def _publish_health(self, world: InspectionWorld, now: rospy.Time) -> None:
        self._battery.publish(
            BatteryState(header=Header(stamp=now), voltage=world.voltage, present=True)
        )
        powered = world.base.powered
        status = DiagnosticStatus(
            DiagnosticStatus.OK if powered else DiagnosticStatus.ERROR,
            OF_THE_BASE,
            'running' if powered else 'the battery is low: the motors are off',
            'base',
            [KeyValue('voltage', '{:.1f} V'.format(world.voltage))],
        )
        self._diagnostics.publish(DiagnosticArray(Header(stamp=now), [status]))

    def publish_image(self, world: InspectionWorld, now: rospy.Time) -> None:
        """Publish what the camera sees, where somebody looks."""
        if not self._image.get_num_connections() and not self._info.get_num_connections():
            return
        header = Header(stamp=now, frame_id=CAMERA)
        matrix = intrinsics()
        self._info.publish(
            CameraInfo(
                header=header,
                height=HEIGHT,
                width=WIDTH,
                distortion_model='plumb_bob',
                D=[0.0] * 5,
                K=matrix.ravel().tolist(),
                R=np.eye(3).ravel().tolist(),
                P=np.hstack([matrix, np.zeros((3, 1))]).ravel().tolist(),
            )
        )
        self._image.publish(
            Image(
                header=header,
                height=HEIGHT,
                width=WIDTH,
                encoding='rgb8',
                step=3 * WIDTH,
                data=world.image().tobytes(),
            )
        )
