"""Images of a robot's camera on request: colour, depth, calibration and pose of one moment.

It listens only while an image is wanted: a camera without listeners costs nothing.
"""

import threading
import time
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple, Union

import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header

from smach_common.connections import live_connections
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of
from smach_oracle.geometry.transforms import from_quaternion
from smach_oracle.ros.connections import ConnectionGrace
from smach_oracle.ros.images import ImageError, cloud_message, colour_of, depth_of, intrinsics_of
from smach_oracle.ros.service_calls import ServerGoneError, call_service
from smach_oracle.srv import Snapshot, SnapshotRequest

SAME_MOMENT_S = 0.02  # between the stamps of colour and depth
# wall time after which another snapshot is asked for: the first may have come before we listened
ATTEMPT_S = 3.0
POLL_S = 0.01
CLOUD_COLUMNS = 213  # of the image that the cloud has points of, about
NO_SNAPSHOT = 'none'
KEPT = 5  # messages of a topic

# the messages that make an image, by 'rgb', 'depth' and 'info'
CameraMessages = Mapping[str, Union[Image, CameraInfo]]


class ImageSourceError(Exception):
    """No image can be had. The text says what is missing."""


class TakenImage(NamedTuple):
    """An image, and the message that its colour came in."""

    message: Image  # with its stamp and frame
    image: CameraImage


class ImageSource:
    """Takes images from three topics and tf."""

    def __init__(
        self,
        rgb: str,
        depth: str,
        camera_info: str,
        base_frame: str,
        snapshot: str = NO_SNAPSHOT,
        limit_s: float = 20.0,
    ) -> None:
        """
        :param rgb: topics. Depth must be registered to colour.
        :param base_frame: the frame of all poses that are handed out. Its z axis points up.
        :param snapshot: service (Snapshot) that publishes an image and returns its stamp, or
            `none` for the next image.
        :param limit_s: wall time that an image may take.
        """
        self.base_frame = base_frame
        self._topics = {
            'rgb': (rgb, Image),
            'depth': (depth, Image),
            'info': (camera_info, CameraInfo),
        }
        self._snapshot = None if snapshot == NO_SNAPSHOT else rospy.resolve_name(snapshot)
        self._limit_s = limit_s
        self._one_at_a_time = threading.Lock()

    def take(self) -> TakenImage:
        """A fresh image.

        :raises ImageSourceError: where none comes in time, or where the messages make no image.
        """
        with self._one_at_a_time:
            subscriptions = _CameraSubscriptions(self._topics)
            try:
                return self._taken(subscriptions)
            except ImageError as err:
                raise ImageSourceError(str(err)) from err
            finally:
                subscriptions.stop()

    def _taken(self, subscriptions: '_CameraSubscriptions') -> TakenImage:
        until_s = time.monotonic() + self._limit_s
        while not subscriptions.connected():
            if time.monotonic() > until_s or rospy.is_shutdown():
                raise ImageSourceError(
                    'nobody publishes {}'.format(', '.join(subscriptions.unpublished()) or '/tf')
                )
            time.sleep(POLL_S)
        while time.monotonic() < until_s and not rospy.is_shutdown():
            taken = self._attempt(subscriptions, until_s)
            if taken is not None:
                return taken
        raise ImageSourceError(
            'no image within {:.0f} s: {}'.format(
                self._limit_s, subscriptions.lacking(self.base_frame)
            )
        )

    def _attempt(
        self, subscriptions: '_CameraSubscriptions', until_s: float
    ) -> Optional[TakenImage]:
        stamp = self._snap(max(until_s - time.monotonic(), POLL_S))
        until_s = min(until_s, time.monotonic() + ATTEMPT_S)
        while time.monotonic() < until_s and not rospy.is_shutdown():
            for messages in subscriptions.of_one_moment(stamp):
                pose = subscriptions.pose(self.base_frame, messages['rgb'].header)
                if pose is not None:
                    return TakenImage(messages['rgb'], _camera_image(messages, pose))
            time.sleep(POLL_S)
        return None

    def _snap(self, limit_s: float) -> Optional[rospy.Time]:
        """The stamp of the image to wait for. None means any."""
        if self._snapshot is None:
            return None
        try:
            answer = call_service(self._snapshot, Snapshot, SnapshotRequest(camera=True), limit_s)
        except ServerGoneError as err:
            raise ImageSourceError(str(err)) from err
        if not answer.ok:
            raise ImageSourceError('{}: {}'.format(self._snapshot, answer.message))
        return answer.stamp


class _CameraSubscriptions:
    """Subscriptions while one image is awaited."""

    def __init__(self, topics: Mapping[str, Tuple[str, type]]) -> None:
        """`topics`: name and type of the topics 'rgb', 'depth' and 'info'."""
        self._lock = threading.Lock()
        self._seen: Dict[str, Dict[rospy.Time, Union[Image, CameraInfo]]] = {
            name: {} for name in topics
        }
        self._grace = ConnectionGrace()
        self._buffer = tf2_ros.Buffer(debug=False)
        self._transforms = tf2_ros.TransformListener(self._buffer)
        self._subscribers = [
            rospy.Subscriber(topic, spec, self._keep, name, queue_size=2, buff_size=1 << 22)
            for name, (topic, spec) in topics.items()
        ]

    def stop(self) -> None:
        for subscriber in self._subscribers:
            subscriber.unregister()
        self._transforms.unregister()

    def connected(self) -> bool:
        """Whether every topic has a publisher. It waits until new ones send to this node."""
        trees = [
            each
            for tree in (self._transforms.tf_sub, self._transforms.tf_static_sub)
            for each in live_connections(tree)
        ]
        cameras = [live_connections(each) for each in self._subscribers]
        if not trees or not all(cameras):
            return False
        self._grace.wait(trees + [each for camera in cameras for each in camera])
        return True

    def unpublished(self) -> List[str]:
        """Topics without a publisher."""
        return [each.resolved_name for each in self._subscribers if not live_connections(each)]

    def of_one_moment(self, stamp: Optional[rospy.Time]) -> List[CameraMessages]:
        """Colour images with their depth and a calibration, newest first.

        With `stamp` the one of exactly that time alone.
        """
        slack_s = SAME_MOMENT_S if stamp is None else 0.0
        with self._lock:
            colours, depths, infos = (self._seen[name] for name in ('rgb', 'depth', 'info'))
            wanted = [stamp] if stamp is not None else sorted(colours, reverse=True)
            if not infos or not depths:
                return []
            pairs = [(each, _nearest(each, depths)) for each in wanted if each in colours]
            return [
                {'rgb': colours[each], 'depth': depths[depth], 'info': infos[max(infos)]}
                for each, depth in pairs
                if abs((depth - each).to_sec()) <= slack_s
            ]

    def pose(self, base_frame: str, header: Header) -> Optional[np.ndarray]:
        """4x4: the base from the camera at the moment of a header, None while not known."""
        try:
            found = self._buffer.lookup_transform_core(
                base_frame, header.frame_id.lstrip('/'), header.stamp
            ).transform
        except tf2_ros.TransformException:
            return None
        return from_quaternion(
            (found.translation.x, found.translation.y, found.translation.z),
            (found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w),
        )

    def lacking(self, base_frame: str) -> str:
        """Return why there is no image."""
        silent = [
            each.resolved_name
            for each, name in zip(self._subscribers, self._seen)
            if not self._seen[name]
        ]
        if silent:
            return 'nothing came on {}'.format(', '.join(silent))
        found = self.of_one_moment(None)
        if not found:
            return 'colour and depth never had the same stamp'
        return 'no transform from {} to {} at the time of the image'.format(
            found[0]['rgb'].header.frame_id or '(no frame)', base_frame
        )

    def _keep(self, message: Union[Image, CameraInfo], name: str) -> None:
        with self._lock:
            kept = self._seen[name]
            kept[message.header.stamp] = message
            while len(kept) > KEPT:
                del kept[min(kept)]


def _nearest(stamp: rospy.Time, stamps: Mapping[rospy.Time, Image]) -> rospy.Time:
    return min(stamps, key=lambda other: abs((other - stamp).to_sec()))


def _camera_image(messages: CameraMessages, base_from_camera: np.ndarray) -> CameraImage:
    """:raises ImageError: where colour, depth or calibration cannot be used."""
    colour, depth = colour_of(messages['rgb']), depth_of(messages['depth'])
    if colour.shape[:2] != depth.shape:
        raise ImageError(
            'colour is {1} x {0}, depth {3} x {2}: depth must be registered to colour'.format(
                *colour.shape[:2], *depth.shape
            )
        )
    return CameraImage(
        messages['rgb'].header.stamp.to_sec(),
        colour,
        depth,
        intrinsics_of(messages['info']),
        base_from_camera,
    )


def cloud_of(taken: TakenImage, base_frame: str) -> PointCloud2:
    """An image as a coloured cloud in the frame of the base, of about CLOUD_COLUMNS columns."""
    image = taken.image
    stride = image.stride(CLOUD_COLUMNS)
    points = points_of(
        image.depth[::stride, ::stride], image.intrinsics, image.base_from_camera, stride=stride
    )
    known = np.isfinite(points[..., 2])
    header = Header(stamp=taken.message.header.stamp, frame_id=base_frame)
    return cloud_message(points[known], header, image.colour[::stride, ::stride][known])
