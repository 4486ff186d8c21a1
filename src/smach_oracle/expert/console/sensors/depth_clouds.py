"""Point clouds of cameras that give depth and a calibration, but no cloud themselves."""

import re
from typing import Dict, List, NamedTuple, Optional, Sequence

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from smach_oracle.geometry.depth import points_of
from smach_oracle.ros.images import ImageError, colour_of, depth_of, intrinsics_of

from .clouds import MOST_SHOWN, Cloud, by_rank, encode_points
from .images import MOST_PIXELS, BrowserFile
from .sensor_streams import SensorStream

AS_A_CLOUD = ' as a cloud'
TYPE = 'depth and camera_info'
SAME_MOMENT_S = 0.05  # between the stamps of depth and colour
_DEPTH = re.compile(r'(.*)/([^/]*depth[^/]*)/image[^/]*')
_COLOUR = re.compile(r'/(rgb|color|colour)/image_(rect_color|color|raw|rect)')
_REGISTERED = re.compile(r'registered|aligned')


class DepthCamera(NamedTuple):
    """Topics of one camera."""

    depth: str
    info: str
    colour: Optional[str]  # where depth is registered to it


def depth_cameras(published: Sequence[Sequence[str]]) -> List[DepthCamera]:
    """Depth cameras that publish no cloud.

    :param published: topics and their types, as the master knows them.
    """
    kinds: Dict[str, List[str]] = {}
    for topic, kind in published:
        kinds.setdefault(kind, []).append(topic)
    infos, images = set(kinds.get(CameraInfo._type, [])), sorted(kinds.get(Image._type, []))
    found = []
    for depth in images:
        split = _DEPTH.fullmatch(depth)
        if split is None or any(
            topic.startswith(split.group(1) + '/') for topic in kinds.get(PointCloud2._type, [])
        ):
            continue
        camera, registered = split.group(1), _REGISTERED.search(split.group(2))
        colour = (
            next(
                (
                    image
                    for image in images
                    if image.startswith(camera + '/') and _COLOUR.fullmatch(image[len(camera) :])
                ),
                None,
            )
            if registered
            else None
        )
        near = [depth, colour] if colour else [depth]
        info = next(
            (
                each
                for each in (image.rsplit('/', 1)[0] + '/camera_info' for image in near)
                if each in infos
            ),
            None,
        )
        if info is not None:
            found.append(DepthCamera(depth, info, colour))
    return found


class DepthCloudStream(SensorStream):
    """Depth images, each made a cloud when somebody asks for it."""

    def __init__(self, sensor: int, camera: DepthCamera) -> None:
        super().__init__(sensor, camera.depth + AS_A_CLOUD, TYPE)
        self._camera = camera
        self._info: Optional[CameraInfo] = None
        self._colour: Optional[Image] = None
        self._others: List[rospy.Subscriber] = []

    def _begin(self) -> rospy.Subscriber:
        topics = [(self._camera.info, CameraInfo, self.take_info)]
        if self._camera.colour is not None:
            topics.append((self._camera.colour, Image, self.take_colour))
        self._others = [
            rospy.Subscriber(topic, kind, take, queue_size=1, buff_size=1 << 24)
            for topic, kind, take in topics
        ]
        return rospy.Subscriber(
            self._camera.depth, Image, self.take, queue_size=1, buff_size=1 << 24
        )

    def _end(self) -> None:
        super()._end()
        for each in self._others:
            each.unregister()
        self._others, self._info, self._colour = [], None, None

    def take_info(self, message: CameraInfo) -> None:
        """The calibration."""
        self._info = message

    def take_colour(self, message: Image) -> None:
        """The newest colour image."""
        self._colour = message

    def _encoded_of(self, message: Image, width: int) -> BrowserFile:
        if self._info is None:
            raise ImageError('nothing comes on {}'.format(self._camera.info))
        cloud = cloud_of_depth(message, self._info, self._colour)
        return encode_points(cloud, message.width * message.height)


def cloud_of_depth(
    depth: Image, info: CameraInfo, colour: Optional[Image] = None, most: int = MOST_SHOWN
) -> Cloud:
    """Return at most so many points, evenly taken, in the camera's optical frame.

    :param colour: gives colours where it is of the same moment and size, else distance does.
    :raises ImageError: for what is no depth image, too large a one, or a camera that is not
        calibrated.
    """
    if depth.width * depth.height > MOST_PIXELS:
        raise ImageError(
            'the image has {} x {} pixels; allowed: {}'.format(
                depth.width, depth.height, MOST_PIXELS
            )
        )
    intrinsics = _scaled(intrinsics_of(info), info, depth)
    stride = max(1, int(np.sqrt(depth.width * depth.height / (2.0 * most))))
    metres = depth_of(depth)[::stride, ::stride]
    points = points_of(metres, intrinsics, np.eye(4), stride=stride)
    kept = np.flatnonzero(np.isfinite(metres.ravel()) & (metres.ravel() < 1e4))
    if len(kept) > most:
        kept = kept[np.linspace(0, len(kept) - 1, most).astype(np.int64)]
    points = points.reshape(-1, 3)[kept]
    if (
        colour is None
        or (colour.width, colour.height) != (depth.width, depth.height)
        or abs((colour.header.stamp - depth.header.stamp).to_sec()) > SAME_MOMENT_S
    ):
        return Cloud(points, by_rank(points[:, 2]))
    return Cloud(points, colour_of(colour)[::stride, ::stride].reshape(-1, 3)[kept])


def _scaled(intrinsics: np.ndarray, info: CameraInfo, depth: Image) -> np.ndarray:
    """Intrinsics for the size of `depth` from a calibration of another size."""
    if not info.width or not info.height:
        return intrinsics
    return np.diag([depth.width / info.width, depth.height / info.height, 1.0]) @ intrinsics
