"""Camera images from the time when questions were asked, kept as files.

Bounded. Any thread may use it.

Those that a robot itself publishes (~failure_frames) come first: it had them before there was a
question. For other robots the console takes images itself, as soon as the question appears.
"""

import itertools
import threading
import time
from collections import OrderedDict
from typing import Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence, Union

import rospy
from sensor_msgs.msg import CompressedImage, Image

from smach_oracle.msg import FailureFrames

from ...followed_server import ListedQuestion
from ...robot_topics import RobotTopics
from ..shapes.questions import KeptImageView
from ..shapes.sensors import SensorView
from ..web.sections import PageSections
from .images import BrowserFile, encode_image
from .robot_cameras import RobotCameras
from .sensor_streams import SensorStreams

SECTION = 'images'
MOST_KEPT = 200
MOST_BYTES = 40 * 2**20  # of all together
MOST_QUESTIONS = 64
MOST_CAMERAS = 2  # from which the console takes images by itself, for one question
# an older image does not belong to the question: the camera may have died since
BEFORE_S = 2.0
TAKE_WITHIN_S = 15.0  # of the question: later images do not show the failure
WIDTH = 640
AT_ONCE_S = 1.0  # the robot's own images within this time are those of the failure


class QuestionImage(NamedTuple):
    """One image of one camera, kept with a question."""

    number: int
    topic: str
    # after its question was asked. None means the robot's own, from the moment of the failure
    late_s: Optional[float]
    width: int  # px of the original
    height: int
    stamp_s: float = 0.0  # by the clock of its camera, or 0 where it has none


class ImageStore:
    """Files by numbers. The oldest are forgotten."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._files: 'OrderedDict[int, BrowserFile]' = OrderedDict()
        self._numbers = itertools.count(1)

    def put(self, encoded: BrowserFile) -> int:
        """Keep one. Return its number."""
        with self._lock:
            number = next(self._numbers)
            self._files[number] = encoded
            while (
                len(self._files) > MOST_KEPT
                or sum(len(each.body) for each in self._files.values()) > MOST_BYTES
            ):
                self._files.popitem(last=False)
            return number

    def find(self, number: int) -> Optional[BrowserFile]:
        """Return a file, or None where it is not kept any more."""
        with self._lock:
            return self._files.get(number)

    def keep(
        self, topic: str, image: Union[Image, CompressedImage], late_s: Optional[float]
    ) -> QuestionImage:
        """Keep an image message as a file.

        :raises ValueError: where it cannot be encoded.
        """
        encoded = encode_image(image, WIDTH)
        width, height = encoded.facts['size']
        return QuestionImage(
            self.put(encoded), topic, late_s, width, height, image.header.stamp.to_sec()
        )


class QuestionImages:
    """The images of open questions."""

    def __init__(
        self, files: ImageStore, sensors: SensorStreams, cameras: Optional[RobotCameras] = None
    ) -> None:
        self._cameras = cameras or RobotCameras(sensors, {})
        self._files = files
        self._sensors = sensors
        self._lock = threading.Lock()
        self._topics = RobotTopics(
            '/failure_frames', FailureFrames, self.taker, queue_size=5, buff_size=1 << 24
        )
        self._sent: 'OrderedDict[str, List[QuestionImage]]' = OrderedDict()  # by robot and query id
        # by question: topic -> our image
        self._seen: 'OrderedDict[str, Dict[str, QuestionImage]]' = OrderedDict()
        self._first: Dict[str, int] = {}  # by question, the number of its first image
        self._failed: Dict[str, float] = {}  # cameras that could not be shown, and when

    def write_sections(self, sections: PageSections, questions: Sequence[ListedQuestion]) -> None:
        """Take images where there are any, and bring the section up to date."""
        now_s = time.monotonic()
        found = {}
        self._topics.follow([listed.goal.robot for listed in questions])
        for listed in questions:
            with self._lock:
                sent = self._sent.get(_key(listed.goal.robot, listed.goal.query_id))
            shown = sent or self._taken(listed, now_s)
            if shown:
                asked_s = listed.goal.asked.to_sec()
                found[listed.key] = [image_view(image, asked_s) for image in shown]
        self._first = {key: images[0]['id'] for key, images in found.items()}
        sections.put(SECTION, found)

    def picture_of(self, key: str) -> Optional[BrowserFile]:
        """Return the first image of an open question, None where there is none yet."""
        number = self._first.get(key)
        return None if number is None else self._files.find(number)

    def _taken(self, listed: ListedQuestion, now_s: float) -> List[QuestionImage]:
        seen = self._seen.get(listed.key)
        if seen is None:
            seen = self._seen[listed.key] = {}
            while len(self._seen) > MOST_QUESTIONS:
                self._seen.popitem(last=False)
        if now_s - listed.asked_s < TAKE_WITHIN_S:
            for camera in self._cameras.of(listed.goal.robot)[:MOST_CAMERAS]:
                if _is_too_old(seen.get(camera['topic']), listed):
                    self._take_image(camera, listed, seen, now_s)
        return list(seen.values())

    def _take_image(
        self,
        camera: SensorView,
        listed: ListedQuestion,
        seen: Dict[str, QuestionImage],
        now_s: float,
    ) -> None:
        sensor = self._sensors.find(camera['id'])
        sample = sensor.newer(0) if sensor is not None else None
        if sample is None or sample.came_s < listed.asked_s - BEFORE_S:
            return
        known = seen.get(camera['topic'])
        if known is not None and sample.message.header.stamp.to_sec() <= known.stamp_s:
            return
        if now_s - self._failed.get(camera['topic'], -TAKE_WITHIN_S) < TAKE_WITHIN_S:
            return
        try:
            seen[camera['topic']] = self._files.keep(
                camera['topic'], sample.message, sample.came_s - listed.asked_s
            )
        except ValueError as err:
            self._failed[camera['topic']] = now_s
            rospy.logdebug('An image of %s cannot be shown: %s', camera['topic'], err)

    def taker(self, robot: str) -> Callable[[FailureFrames], None]:
        """Return the callback for a robot's messages."""

        def take(message: FailureFrames) -> None:
            images = list(stored_images(self._files, message.topics, message.images))
            with self._lock:
                self._sent[_key(robot, message.query_id)] = images
                while len(self._sent) > MOST_QUESTIONS:
                    self._sent.popitem(last=False)

        return take


def stored_images(
    files: ImageStore, topics: Sequence[str], images: Sequence[CompressedImage]
) -> Iterable[QuestionImage]:
    """Keep a robot's images, four at most. Those that cannot be encoded are left out."""
    for topic, image in list(zip(topics, images))[:4]:
        try:
            yield files.keep(topic[:200], image, None)
        except ValueError as err:
            rospy.logdebug('An image of %s cannot be shown: %s', topic, err)


def image_view(image: QuestionImage, asked_s: float = 0.0) -> KeptImageView:
    """Return an image as plain data.

    :param asked_s: when the question was put, by the robot's ROS clock. 0 means not known.
    """
    stamped = bool(image.stamp_s and asked_s)
    late = image.stamp_s - asked_s if stamped else image.late_s
    if late is not None and image.late_s is None and abs(late) < AT_ONCE_S:
        late = None
    return {
        'id': image.number,
        'topic': image.topic,
        'late': None if late is None else round(late, 1),
        'stamped': stamped or late is None,
        'size': (image.width, image.height),
    }


def _is_too_old(image: Optional[QuestionImage], listed: ListedQuestion) -> bool:
    """Whether another image is wanted: there is none, or a latched one of long before."""
    return image is None or bool(
        image.stamp_s and image.stamp_s < listed.goal.asked.to_sec() - BEFORE_S
    )


def _key(robot: str, query_id: str) -> str:
    return '{} {}'.format(robot, query_id)
