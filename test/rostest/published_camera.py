"""A camera on real topics whose frames are cast from a scene: it streams, and it answers
snapshots.
"""

import os
import sys
import threading

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

sys.path.insert(
    0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'unit', 'support')
)
from ray_camera import INTRINSICS, camera_at, see

from smach_oracle.geometry.transforms import quaternion
from smach_oracle.ros.images import colour_image, depth_image
from smach_oracle.srv import Snapshot, SnapshotResponse

POSE = camera_at((0.05, 0.03, 1.38), (0.75, 0.0, 0.75))
OPTICAL = 'camera_optical_frame'


class PublishedCamera:
    """Shows the bodies that it was given last."""

    def __init__(self, name: str, bodies, streams: bool) -> None:
        topic = name + '/rgb/', name + '/depth_registered/'
        self._rgb = rospy.Publisher(topic[0] + 'image_raw', Image, queue_size=1)
        self._depth = rospy.Publisher(topic[1] + 'image_raw', Image, queue_size=1)
        self._info = rospy.Publisher(topic[0] + 'camera_info', CameraInfo, queue_size=1)
        self._lock = threading.Lock()
        self._transforms = tf2_ros.StaticTransformBroadcaster()
        self.tell_place()
        self.show(bodies)
        self.shots = 0
        if streams:
            threading.Thread(target=self._stream, daemon=True).start()
        else:
            self._service = rospy.Service('world/snapshot', Snapshot, self._snap)

    def tell_place(self, *more) -> None:
        """Where its frame is, and that these are there, too."""
        place = Transform(Vector3(*POSE[:3, 3]), Quaternion(*quaternion(POSE)))
        self._transforms.sendTransform(
            [
                TransformStamped(Header(frame_id='base_footprint'), frame, place)
                for frame in (OPTICAL,) + more
            ]
        )

    def show(self, bodies) -> None:
        self._seen = see(bodies, POSE, np.random.default_rng(5))

    @property
    def viewers(self) -> int:
        """How many look at its colour pictures."""
        return self._rgb.get_num_connections()

    def pixels(self, index: int) -> np.ndarray:
        """(h, w) bool: where a body is seen."""
        return self._seen.bodies == index

    def _stream(self) -> None:
        while not rospy.is_shutdown():
            self._publish(rospy.Time.now())
            rospy.rostime.wallsleep(0.1)  # ten pictures a second

    def _snap(self, _request) -> SnapshotResponse:
        stamp = rospy.Time.now()
        self.shots += 1
        self._publish(stamp)
        return SnapshotResponse(True, '', stamp)

    def _publish(self, stamp: rospy.Time) -> None:
        with self._lock:
            if not self._rgb.get_num_connections():
                return
            header = Header(stamp=stamp, frame_id=OPTICAL)
            self._info.publish(
                CameraInfo(header=header, height=480, width=640, K=list(INTRINSICS.ravel()))
            )
            self._depth.publish(depth_image(self._seen.image.depth, header))
            self._rgb.publish(colour_image(self._seen.image.colour, header))
