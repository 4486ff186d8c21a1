"""The last seconds before the failures that led to questions, as their robots publish them.

Bounded, in number and in bytes. A robot's word is checked: what does not fit is left out.
"""

import itertools
import math
import threading
from collections import OrderedDict, defaultdict
from typing import (
    Callable,
    DefaultDict,
    Dict,
    Iterator,
    List,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
)

import genpy
from sensor_msgs.msg import CompressedImage

from smach_oracle.msg import FailureReplay, OracleEvent

from ...followed_server import ListedQuestion
from ...robot_topics import RobotTopics
from ..feeds.views import event_of, event_view, number
from ..shapes.sensors import JointCurveView, ReplayEventView, ReplayView
from ..web.sections import PageSections

SECTION = 'replays'
TOPIC = '/failure_replay'  # behind the robot's name
MOST_KEPT = 64
MOST_BYTES = 64 * 2**20  # of all together
MOST_FRAMES = 2400  # of one
MOST_EVENTS = 300
MOST_CAMERAS = 4
MOST_CURVES = 4
SHORTEST_S, LONGEST_S = 1.0, 600.0
LATE_S = 0.5  # an item may have come so long after the failure


_NUMBERS = itertools.count(1)


def next_number() -> int:
    """Return a number by which the page may ask for a replay, whoever keeps it."""
    return next(_NUMBERS)


class KeptReplay(NamedTuple):
    """A replay for the page, and its images."""

    view: ReplayView
    images: List[CompressedImage]  # of each frame of the view

    @property
    def bytes(self) -> int:
        """The bytes of its images."""
        return sum(len(image.data) for image in self.images)


class QuestionReplays:
    """The replays of the questions that came last. Any thread may use it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: 'OrderedDict[int, KeptReplay]' = OrderedDict()
        self._number_of: Dict[Tuple[str, str], int] = {}  # by robot and query id
        self._topics = RobotTopics(
            TOPIC, FailureReplay, self.taker, queue_size=2, buff_size=1 << 24
        )

    def write_sections(self, sections: PageSections, questions: Sequence[ListedQuestion]) -> None:
        """Listen to the robots that ask, and bring the section up to date. One thread calls it."""
        self._topics.follow([listed.goal.robot for listed in questions])
        with self._lock:
            found = {
                listed.key: self._number_of.get((listed.goal.robot, listed.goal.query_id))
                for listed in questions
            }
        sections.put(SECTION, {key: known for key, known in found.items() if known is not None})

    def find(self, replay: int) -> Optional[KeptReplay]:
        """Return a replay by its number, None where it is not kept any more."""
        with self._lock:
            return self._kept.get(replay)

    def taker(self, robot: str) -> Callable[[FailureReplay], None]:
        """Return the callback for a robot's messages."""

        def take(message: FailureReplay) -> None:
            self.keep(robot, message)

        return take

    def keep(self, robot: str, message: FailureReplay) -> None:
        """Keep a robot's message. One without images, joints and events is not kept."""
        kept = kept_replay(message)
        if not (kept.view['frames'] or kept.view['joints'] or kept.view['events']):
            return
        with self._lock:
            replay = next_number()
            before = self._number_of.pop((robot, message.query_id), None)
            if before is not None:
                del self._kept[before]
            self._kept[replay] = kept
            self._number_of[robot, message.query_id] = replay
            while len(self._kept) > MOST_KEPT or (
                sum(each.bytes for each in self._kept.values()) > MOST_BYTES
            ):
                gone, _ = self._kept.popitem(last=False)
                self._number_of = {
                    key: known for key, known in self._number_of.items() if known != gone
                }


def kept_replay(message: FailureReplay) -> KeptReplay:
    """Return a message as the page gets it. Times become seconds after the failure."""
    seconds = message.seconds if math.isfinite(message.seconds) else SHORTEST_S
    seconds = min(LONGEST_S, max(SHORTEST_S, seconds))
    at = message.header.stamp
    topics = [topic[:200] for topic in message.topics[:MOST_CAMERAS]]
    frames: List[Tuple[int, float]] = []
    images: List[CompressedImage] = []
    for came, camera, image in zip(message.images_came, message.cameras, message.images):
        time_s = _after(came, at, seconds)
        if time_s is not None and camera < len(topics) and len(frames) < MOST_FRAMES:
            frames.append((camera, time_s))
            images.append(image)
    view: ReplayView = {
        'seconds': seconds,
        'cameras': topics,
        'frames': frames,
        'events': list(_events(message.events[-MOST_EVENTS:], at, seconds)),
        'joints': _curves(message, at, seconds),
    }
    return KeptReplay(view, images)


def _after(came: genpy.Time, at: genpy.Time, seconds: float) -> Optional[float]:
    """Seconds after the failure, below 0 before it. None where it does not belong to it."""
    time_s = (came - at).to_sec()
    return round(min(time_s, 0.0), 2) if -seconds - LATE_S <= time_s <= LATE_S else None


def _events(
    events: Sequence[OracleEvent], at: genpy.Time, seconds: float
) -> Iterator[ReplayEventView]:
    for event in events:
        time_s = _after(event.header.stamp, at, seconds)
        if time_s is not None:
            view = event_view(event_of(event))
            yield {'t': time_s, 'kind': view['kind'], 'words': view['words']}


def _curves(message: FailureReplay, at: genpy.Time, seconds: float) -> List[JointCurveView]:
    """The joints that moved most, the one that moved furthest first."""
    curves: DefaultDict[str, List[Tuple[float, float]]] = defaultdict(list)
    for came, joints in zip(message.joints_came, message.joints):
        time_s = _after(came, at, seconds)
        if time_s is None:
            continue
        for name, position in zip(joints.name, joints.position):
            value = number(position)
            if value is not None:
                curves[name[:200]].append((time_s, round(value, 4)))

    def moved(name: str) -> float:
        values = [value for _, value in curves[name]]
        return max(values) - min(values)

    chosen = sorted(curves, key=lambda name: (-moved(name), name))[:MOST_CURVES]
    return [{'name': name, 'samples': curves[name]} for name in chosen]
