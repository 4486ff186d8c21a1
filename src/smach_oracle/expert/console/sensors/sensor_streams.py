"""The sensors that people may watch: topics found by type, subscribed to only while watched.

A browser names a sensor by the number that it was given here. Whatever has no number cannot be
named.
"""

import itertools
import json
import threading
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

import rospy
from sensor_msgs.msg import CompressedImage, Image, JointState, PointCloud2

from ..shapes.basics import SensorKind
from ..shapes.sensors import SensorView
from .clouds import encode_cloud, encode_joints
from .images import BrowserFile, encode_image

MOST_SENSORS = 400
MOST_LISTENED = 16
IDLE_S = 6.0  # after the last request
_GONE_AFTER = 3  # rounds in which the master did not know it
SensorMessage = Union[Image, CompressedImage, PointCloud2, JointState]
_TYPES: Dict[str, Tuple[SensorKind, type, Callable[[Any, int], BrowserFile]]] = {
    Image._type: ('image', Image, encode_image),
    CompressedImage._type: ('image', CompressedImage, encode_image),
    PointCloud2._type: ('cloud', PointCloud2, lambda message, _: encode_cloud(message)),
    JointState._type: ('joints', JointState, lambda message, _: encode_joints(message)),
}
# by type, what they show
_DERIVED: Dict[str, SensorKind] = {'robot_description': 'robot', 'depth and camera_info': 'cloud'}


class SensorSample(NamedTuple):
    """A message as it came."""

    sequence: int  # of its sensor, from 1
    message: SensorMessage
    came_s: float  # monotonic


class SensorStream:
    """One topic, of which the newest message is held."""

    def __init__(self, sensor: int, topic: str, kind: str) -> None:
        """`kind`: a type that can be shown, such as sensor_msgs/Image, or a derived one."""
        self.number = sensor
        self.topic = topic
        self.type = kind
        self.kind = _DERIVED[kind] if kind in _DERIVED else _TYPES[kind][0]
        self._asked_s = -IDLE_S
        self._sequence = itertools.count(1)
        self._sample: Optional[SensorSample] = None
        self._subscriber: Optional[rospy.Subscriber] = None
        self._lock = threading.Lock()
        self._encoded: Dict[Tuple[int, int], Tuple[BrowserFile, str]] = {}

    @property
    def listened(self) -> bool:
        """Whether it is subscribed to."""
        return self._subscriber is not None

    def newer(self, than: int) -> Optional[SensorSample]:
        """The newest sample, None where it is number `than`. It keeps the subscription alive."""
        self._asked_s = time.monotonic()
        sample = self._sample
        return sample if sample is not None and sample.sequence != than else None

    def file_of(self, sample: SensorSample, width: int) -> Tuple[BrowserFile, str]:
        """A sample as a browser gets it, and its facts as JSON. Several browsers share the work.

        :raises ValueError: for a message that cannot be shown. The text says why.
        """
        with self._lock:
            key = (sample.sequence, width)
            if key not in self._encoded:
                self._encoded = {
                    known: found
                    for known, found in self._encoded.items()
                    if known[0] == sample.sequence
                }
                self._encoded[key] = self._made(sample, width)
            return self._encoded[key]

    def update_subscription(self, may_listen: bool) -> None:
        """Subscribe while somebody watches, unsubscribe when nobody does.

        One thread calls it. A master may hang it.
        """
        wanted = time.monotonic() - self._asked_s < IDLE_S
        if self._subscriber is None:
            if wanted and may_listen:
                self._subscriber = self._begin()
        elif wanted:
            self._go_on()
        else:
            self._end()

    def take(self, message: SensorMessage) -> None:
        """Take in a message."""
        self._sample = SensorSample(next(self._sequence), message, time.monotonic())

    def _begin(self) -> rospy.Subscriber:
        return rospy.Subscriber(
            self.topic, _TYPES[self.type][1], self.take, queue_size=1, buff_size=1 << 24
        )

    def _go_on(self) -> None:
        """Called while it is watched."""

    def _end(self) -> None:
        if self._subscriber is not None:
            self._subscriber.unregister()
        self._subscriber, self._sample, self._encoded = None, None, {}

    def _encoded_of(self, message: SensorMessage, width: int) -> BrowserFile:
        return _TYPES[self.type][2](message, width)

    def _made(self, sample: SensorSample, width: int) -> Tuple[BrowserFile, str]:
        encoded = self._encoded_of(sample.message, width)
        header = sample.message.header
        facts = dict(
            encoded.facts,
            sequence=sample.sequence,
            frame=header.frame_id[:200],
            stamp='{}.{:09d}'.format(header.stamp.secs, header.stamp.nsecs),
        )
        if encoded.content_type == 'application/json':
            return encoded._replace(body=json.dumps(facts, allow_nan=False).encode()), ''
        return encoded, json.dumps(facts, allow_nan=False)


class DerivedStream(NamedTuple):
    """A stream that is more than a topic."""

    topic: str  # its name
    type: str
    make: Callable[[int], SensorStream]  # from its number


class SensorStreams:
    """The closed set of sensors."""

    def __init__(self) -> None:
        self._by_number: Dict[int, SensorStream] = {}
        self._unseen: Dict[int, int] = {}
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()

    def find(self, sensor: int) -> Optional[SensorStream]:
        """Return a sensor by its number, or None where it has never been given."""
        return self._by_number.get(sensor)

    def on(self, topic: str) -> Optional[SensorStream]:
        """Return a sensor by its topic, for the server's own use."""
        return next((each for each in self._all() if each.topic == topic), None)

    def follow(
        self, published: Sequence[Sequence[str]], derived: Sequence[DerivedStream] = ()
    ) -> None:
        """Take in the topics and types that the master knows, and the streams derived from them."""
        makers = {(each.topic, each.type): each.make for each in derived}
        seen = {(topic, kind) for topic, kind in published if kind in _TYPES} | set(makers)
        with self._lock:
            known = {(each.topic, each.type): each.number for each in self._by_number.values()}
            for key, sensor in known.items():
                self._unseen[sensor] = 0 if key in seen else self._unseen.get(sensor, 0) + 1
                if self._unseen[sensor] >= _GONE_AFTER and not self._by_number[sensor].listened:
                    del self._by_number[sensor], self._unseen[sensor]
            for topic, kind in sorted(seen - set(known))[: MOST_SENSORS - len(self._by_number)]:
                number = next(self._numbers)
                make = makers.get((topic, kind))
                self._by_number[number] = (
                    make(number) if make else SensorStream(number, topic, kind)
                )

    def update_subscriptions(self) -> None:
        """Subscribe and unsubscribe as needed. It is to be called often, by one thread."""
        for sensor in self._all():
            listened = sum(each.listened for each in self._all())
            sensor.update_subscription(listened < MOST_LISTENED)

    def view(self) -> List[SensorView]:
        """Return the streams as plain data, by topic."""
        return [
            {'id': each.number, 'topic': each.topic, 'kind': each.kind, 'type': each.type}
            for each in sorted(self._all(), key=lambda sensor: (sensor.topic, sensor.number))
        ]

    def _all(self) -> List[SensorStream]:
        with self._lock:
            return list(self._by_number.values())
