"""The head camera's images as messages."""

from typing import Sequence

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header

from smach_oracle.geometry.depth import points_of
from smach_oracle.pr2.robot import CAMERA_FRAME
from smach_oracle.ros.images import cloud_message, colour_image, depth_image


class CameraPublisher:
    """Topics head_camera/rgb/... and head_camera/depth_registered/..."""

    def __init__(self) -> None:
        def publisher(name: str, kind: type) -> rospy.Publisher:
            return rospy.Publisher('head_camera/' + name, kind, queue_size=2)

        self._colour = publisher('rgb/image_raw', Image)
        self._colour_info = publisher('rgb/camera_info', CameraInfo)
        self._depth = publisher('depth_registered/image_raw', Image)
        self._depth_info = publisher('depth_registered/camera_info', CameraInfo)
        self._cloud = publisher('depth_registered/points', PointCloud2)

    @property
    def wanted(self) -> bool:
        """Whether an image or a cloud has a subscriber."""
        return any(each.get_num_connections() for each in (self._colour, self._depth, self._cloud))

    def publish(
        self, colour: np.ndarray, depth: np.ndarray, intrinsics: np.ndarray, stamp: rospy.Time
    ) -> None:
        """Publish one image on the topics that have subscribers.

        :param colour: (h, w, 3) uint8, RGB.
        :param depth: (h, w) float32, m along the optical axis, NaN where nothing was measured.
        :param intrinsics: (3, 3).
        """
        header = Header(stamp=stamp, frame_id=CAMERA_FRAME)
        info = camera_info(intrinsics, colour.shape, header)
        for publisher, message in (
            (self._colour_info, lambda: info),
            (self._depth_info, lambda: info),
            (self._colour, lambda: colour_image(colour, header)),
            (self._depth, lambda: depth_image(depth, header)),
            (self._cloud, lambda: self._cloud_of(colour, depth, intrinsics, header)),
        ):
            if publisher.get_num_connections():
                publisher.publish(message())

    @staticmethod
    def _cloud_of(
        colour: np.ndarray, depth: np.ndarray, intrinsics: np.ndarray, header: Header
    ) -> PointCloud2:
        return cloud_message(
            points_of(depth, intrinsics, np.eye(4)).astype(np.float32), header, colour
        )


def camera_info(intrinsics: np.ndarray, shape: Sequence[int], header: Header) -> CameraInfo:
    """The calibration of a camera without distortion.

    :param intrinsics: (3, 3).
    :param shape: height and width, px.
    """
    projection = np.hstack([intrinsics, np.zeros((3, 1))])
    return CameraInfo(
        header=header,
        height=shape[0],
        width=shape[1],
        distortion_model='plumb_bob',
        D=[0.0] * 5,
        K=intrinsics.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=projection.ravel().tolist(),
    )
