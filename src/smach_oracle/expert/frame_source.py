"""Frames of a robot's camera, on request: colour, depth, calibration and the camera's pose, of one moment.

It listens only while a frame is wanted: a camera that nobody listens to costs nothing.
"""
import threading
import time
from typing import Any, Dict, List, NamedTuple, Optional

import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header

from smach_oracle.srv import Snapshot, SnapshotRequest

from ..geometry.depth import points_of
from ..geometry.transforms import from_quaternion
from ..ros.images import ImageError, cloud_message, colour_of, depth_of, intrinsics_of
from .followed_server import ServerGoneError, call_service
from .segmentation import Picture

SAME_MOMENT_S = 0.02  # between the stamps of colour and depth
ATTEMPT_S = 3.0  # wall time after which another snapshot is asked for: the first may have come before we listened
POLL_S = 0.01
CLOUD_STRIDE = 3
NO_SNAPSHOT = 'none'


class FrameError(Exception):
    """No frame can be had; the text says what is missing."""


class Shot(NamedTuple):
    """A frame as it came."""

    image: Image  # colour, with its stamp and frame
    picture: Picture


class FrameSource:
    """Takes frames from three topics and tf."""

    def __init__(self, rgb: str, depth: str, camera_info: str, base_frame: str, snapshot: str = NO_SNAPSHOT,
                 limit_s: float = 20.0) -> None:
        """
        :param rgb: topics; depth must be registered to colour.
        :param base_frame: the frame in which objects are told; its z axis points up.
        :param snapshot: service (Snapshot) that publishes a frame and says its stamp; `none`: take the next one.
        :param limit_s: wall time that a frame may take.
        """
        self.base_frame = base_frame
        self._topics = {'rgb': (rgb, Image), 'depth': (depth, Image), 'info': (camera_info, CameraInfo)}
        self._snapshot = None if snapshot == NO_SNAPSHOT else rospy.resolve_name(snapshot)
        self._limit_s = limit_s
        self._one_at_a_time = threading.Lock()

    def take(self) -> Shot:
        """A fresh frame.

        :raises FrameError: where none comes in time, or what comes is no frame.
        """
        with self._one_at_a_time:
            listening = _Listening(self._topics)
            try:
                return self._taken(listening)
            except ImageError as err:
                raise FrameError(str(err)) from err
            finally:
                listening.stop()

    def _taken(self, listening: '_Listening') -> Shot:
        until = time.monotonic() + self._limit_s
        while not listening.connected():
            if time.monotonic() > until or rospy.is_shutdown():
                raise FrameError('nobody publishes {}'.format(', '.join(listening.missing()) or '/tf'))
            time.sleep(POLL_S)
        while time.monotonic() < until and not rospy.is_shutdown():
            shot = self._attempt(listening, until)
            if shot is not None:
                return shot
        raise FrameError('no frame within {:.0f} s: {}'.format(self._limit_s, listening.lacking(self.base_frame)))

    def _attempt(self, listening: '_Listening', until: float) -> Optional[Shot]:
        stamp = self._snap(max(until - time.monotonic(), POLL_S))
        until = min(until, time.monotonic() + ATTEMPT_S)
        while time.monotonic() < until and not rospy.is_shutdown():
            for images in listening.of_one_moment(stamp):
                pose = listening.pose(self.base_frame, images['rgb'].header)
                if pose is not None:
                    return Shot(images['rgb'], _picture(images, pose))
            time.sleep(POLL_S)
        return None

    def _snap(self, limit_s: float) -> Optional[rospy.Time]:
        """The stamp of the frame to wait for; None: any."""
        if self._snapshot is None:
            return None
        try:
            answer = call_service(self._snapshot, Snapshot, SnapshotRequest(camera=True), limit_s)
        except ServerGoneError as err:
            raise FrameError(str(err)) from err
        if not answer.ok:
            raise FrameError('{}: {}'.format(self._snapshot, answer.message))
        return answer.stamp


class _Listening:
    """Subscriptions while one frame is awaited."""

    def __init__(self, topics: Dict[str, Any]) -> None:
        self._lock = threading.Lock()
        self._seen: Dict[str, Dict[Any, Any]] = {name: {} for name in topics}
        self._buffer = tf2_ros.Buffer(debug=False)
        self._transforms = tf2_ros.TransformListener(self._buffer)
        self._subscribers = [rospy.Subscriber(topic, spec, self._keep, name, queue_size=2, buff_size=1 << 22)
                             for name, (topic, spec) in topics.items()]

    def stop(self) -> None:
        for subscriber in self._subscribers:
            subscriber.unregister()
        self._transforms.unregister()

    def connected(self) -> bool:
        trees = (self._transforms.tf_sub, self._transforms.tf_static_sub)
        return not self.missing() and any(each.get_num_connections() for each in trees)

    def missing(self) -> List[str]:
        """Topics that nobody publishes."""
        return [each.resolved_name for each in self._subscribers if not each.get_num_connections()]

    def of_one_moment(self, stamp: Optional[rospy.Time]) -> List[Dict[str, Any]]:
        """Colour images with their depth and a calibration, newest first; or only the one of exactly `stamp`."""
        found = []
        with self._lock:
            colours, depths, infos = (self._seen[name] for name in ('rgb', 'depth', 'info'))
            for each in [stamp] if stamp is not None else sorted(colours, reverse=True):
                depth = min(depths, key=lambda other: abs((other - each).to_sec()), default=None)  # noqa: B023
                slack_s = SAME_MOMENT_S if stamp is None else 0.0
                if each in colours and infos and depth is not None and abs((depth - each).to_sec()) <= slack_s:
                    found.append({'rgb': colours[each], 'depth': depths[depth], 'info': infos[max(infos)]})
        return found

    def pose(self, base_frame: str, header: Any) -> Optional[np.ndarray]:
        """4x4: the base from the camera at the moment of a header; None as long as it is not known."""
        try:
            found = self._buffer.lookup_transform_core(base_frame, header.frame_id.lstrip('/'), header.stamp).transform
        except tf2_ros.TransformException:
            return None
        return from_quaternion((found.translation.x, found.translation.y, found.translation.z),
                               (found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w))

    def lacking(self, base_frame: str) -> str:
        """What has not come."""
        silent = [each.resolved_name for each, name in zip(self._subscribers, self._seen) if not self._seen[name]]
        if silent:
            return 'nothing came on {}'.format(', '.join(silent))
        found = self.of_one_moment(None)
        if not found:
            return 'colour and depth never had the same stamp'
        return 'no transform from {} to {} at the time of the image'.format(
            found[0]['rgb'].header.frame_id or '(no frame)', base_frame)

    def _keep(self, message: Any, name: str) -> None:
        with self._lock:
            kept = self._seen[name]
            kept[message.header.stamp] = message
            while len(kept) > 5:
                del kept[min(kept)]


def _picture(images: Dict[str, Any], base_from_camera: np.ndarray) -> Picture:
    colour, depth = colour_of(images['rgb']), depth_of(images['depth'])
    if colour.shape[:2] != depth.shape:
        raise ImageError('colour is {1} x {0}, depth {3} x {2}: depth must be registered to colour'.format(
            *colour.shape[:2], *depth.shape))
    return Picture(images['rgb'].header.stamp.to_sec(), colour, depth, intrinsics_of(images['info']), base_from_camera)


def cloud_of(shot: Shot, base_frame: str) -> PointCloud2:
    """What a frame shows, with its colours, in the frame of the base: points of every CLOUD_STRIDE-th pixel."""
    picture = shot.picture
    points = points_of(picture.depth[::CLOUD_STRIDE, ::CLOUD_STRIDE], picture.intrinsics, picture.base_from_camera,
                       stride=CLOUD_STRIDE)
    known = np.isfinite(points[..., 2])
    return cloud_message(points[known], Header(stamp=shot.image.header.stamp, frame_id=base_frame),
                         picture.colour[::CLOUD_STRIDE, ::CLOUD_STRIDE][known])
