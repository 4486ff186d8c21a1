"""What cameras saw when questions were put, kept as files that a browser can show. Bounded; any thread.

A robot that tells it (~failure_frames) is believed first: it had the frame before there was a question. For others the
console looks itself, as soon as the question appears.
"""
import itertools
import re
import threading
import time
from collections import OrderedDict
from typing import Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence

import rospy
from sensor_msgs.msg import CompressedImage

from smach_oracle.msg import FailureFrames

from ..followed_server import Listed
from .images import Encoded, encode_image
from .robot_topics import RobotTopics
from .sections import Sections
from .sensors import Sensors

SECTION = 'stills'
MOST_KEPT = 200
MOST_BYTES = 40 * 2 ** 20  # of all together
MOST_QUESTIONS = 64
MOST_CAMERAS = 2  # that the console looks at by itself, for one question
BEFORE_S = 2.0  # a frame that came earlier before the question is none of it: the camera may have died since
LOOK_WITHIN_S = 15.0  # of the question: what is seen later tells nothing of the failure
WIDTH = 640
_NO_COLOUR = re.compile('depth|disparity|/ir/')
_RANK = [re.compile(pattern) for pattern in ('/(rgb|color|colour)/', 'image_(raw|rect|color)', '')]


class Still(NamedTuple):
    """One frame of one camera."""

    number: int
    topic: str
    late_s: Optional[float]  # after its question was put; None: it is the robot's, from the moment itself
    width: int  # px of the original
    height: int


class StillFiles:
    """Files by numbers; the oldest are forgotten."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._files: 'OrderedDict[int, Encoded]' = OrderedDict()
        self._numbers = itertools.count(1)

    def put(self, encoded: Encoded) -> int:
        """Keep one; its number."""
        with self._lock:
            number = next(self._numbers)
            self._files[number] = encoded
            while len(self._files) > MOST_KEPT or sum(len(each.body) for each in self._files.values()) > MOST_BYTES:
                self._files.popitem(last=False)
            return number

    def find(self, number: int) -> Optional[Encoded]:
        """A file; None where it is not kept any more."""
        with self._lock:
            return self._files.get(number)

    def keep(self, topic: str, image: Any, late_s: Optional[float]) -> Still:
        """Make a file of an image message. Raises ValueError where that cannot be done."""
        encoded = encode_image(image, WIDTH)
        width, height = encoded.facts['size']
        return Still(self.put(encoded), topic, late_s, width, height)


class Stills:
    """Of the questions that are open."""

    def __init__(self, files: StillFiles, sensors: Sensors) -> None:
        self._files = files
        self._sensors = sensors
        self._lock = threading.Lock()
        self._topics = RobotTopics('/failure_frames', FailureFrames, self.taker, queue_size=5, buff_size=1 << 24)
        self._told: 'OrderedDict[str, List[Still]]' = OrderedDict()  # by robot and query id
        self._seen: 'OrderedDict[str, Dict[str, Still]]' = OrderedDict()  # by question: topic -> what we saw
        self._failed: Dict[str, float] = {}  # cameras that could not be shown, and when

    def draw(self, sections: Sections, questions: Sequence[Listed]) -> None:
        """Look where there is something to be seen, and bring the section up to date."""
        now_s = time.monotonic()
        found = {}
        self._topics.follow([listed.goal.robot for listed in questions])
        for listed in questions:
            with self._lock:
                told = self._told.get(_name(listed.goal.robot, listed.goal.query_id))
            shown = told or self._looked(listed, now_s)
            if shown:
                found[listed.key] = [still_view(still) for still in shown]
        sections.put(SECTION, found)

    def _looked(self, listed: Listed, now_s: float) -> List[Still]:
        seen = self._seen.get(listed.key)
        if seen is None:
            seen = self._seen[listed.key] = {}
            while len(self._seen) > MOST_QUESTIONS:
                self._seen.popitem(last=False)
        if now_s - listed.asked_s < LOOK_WITHIN_S:
            for camera in cameras_of(listed.goal.robot, self._sensors.view())[:MOST_CAMERAS]:
                if camera['topic'] not in seen:
                    self._look(camera, listed, seen, now_s)
        return list(seen.values())

    def _look(self, camera: Dict[str, Any], listed: Listed, seen: Dict[str, Still], now_s: float) -> None:
        sensor = self._sensors.find(camera['id'])
        frame = sensor.newer(0) if sensor is not None else None
        if frame is None or frame.came_s < listed.asked_s - BEFORE_S:
            return
        if now_s - self._failed.get(camera['topic'], -LOOK_WITHIN_S) < LOOK_WITHIN_S:
            return
        try:
            seen[camera['topic']] = self._files.keep(camera['topic'], frame.message, frame.came_s - listed.asked_s)
        except ValueError as err:
            self._failed[camera['topic']] = now_s
            rospy.logdebug('What %s saw cannot be shown: %s', camera['topic'], err)

    def taker(self, robot: str) -> Callable[[FailureFrames], None]:
        """What takes in a robot's messages."""
        def take(message: FailureFrames) -> None:
            stills = list(kept_frames(self._files, message.topics, message.images))
            with self._lock:
                self._told[_name(robot, message.query_id)] = stills
                while len(self._told) > MOST_QUESTIONS:
                    self._told.popitem(last=False)
        return take


def kept_frames(files: StillFiles, topics: Sequence[str], images: Sequence[CompressedImage]) -> Iterable[Still]:
    """Files of a robot's frames, four at most; those that cannot be shown are left out."""
    for topic, image in list(zip(topics, images))[:4]:
        try:
            yield files.keep(topic[:200], image, None)
        except ValueError as err:
            rospy.logdebug('A frame of %s cannot be shown: %s', topic, err)


def still_view(still: Still) -> Dict[str, Any]:
    """As plain data."""
    late = None if still.late_s is None else round(still.late_s, 1)
    return {'id': still.number, 'topic': still.topic, 'late': late, 'size': [still.width, still.height]}


def cameras_of(robot: str, sensors: Sequence[Dict[str, Any]]) -> List[Dict[str, Any]]:
    """Colour cameras of a robot's namespace, or of all where it has none of its own; the likeliest first."""
    space = robot[:robot.rfind('/') + 1]
    cameras = [each for each in sensors if each['kind'] == 'image' and not _NO_COLOUR.search(each['topic'])]
    own = [each for each in cameras if each['topic'].startswith(space)]
    return sorted(own or cameras, key=lambda each: (
        next(rank for rank, pattern in enumerate(_RANK) if pattern.search(each['topic'])), each['topic']))


def _name(robot: str, query_id: str) -> str:
    return '{} {}'.format(robot, query_id)
