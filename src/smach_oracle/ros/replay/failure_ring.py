"""The ring of one robot: small images, joint states and events of the last seconds."""

import itertools
import threading
from typing import Dict, List, NamedTuple, Sequence, Tuple

import genpy
from sensor_msgs.msg import CompressedImage, JointState

from smach_oracle.msg import FailureReplay
from smach_oracle.oracle.records.events import Event

from ..event_messages import json_of, to_msg
from ..sendable_text import sendable_text
from .replay_settings import ReplaySettings
from .timed_ring import TimedRing

# of the bytes: a fast machine must not push the images out
IMAGE_SHARE, JOINT_SHARE, EVENT_SHARE = 2 / 3, 1 / 4, 1 / 12
_OF_A_HEADER = 60  # bytes on the wire of what is not counted one by one: header, lengths, times
_OF_AN_OBJECT = 700  # bytes that Python takes for a message, besides its content
_OF_AN_EVENT = 700
_OF_A_FLOAT = 32  # as an object, and its place in a list
_OF_A_NAME = 58


class KeptImage(NamedTuple):
    """A small image of one camera."""

    number: int  # of all that was kept, in the order in which it was
    came: genpy.Time  # ROS time
    camera: int  # index of the settings' cameras
    image: CompressedImage
    wire: int  # bytes of it in a message


class KeptJoints(NamedTuple):
    """A joint state."""

    number: int
    came: genpy.Time
    joints: JointState
    wire: int


class Before(NamedTuple):
    """The content of a ring at a failure."""

    at: genpy.Time
    images: List[KeptImage]
    joints: List[KeptJoints]
    events: List[Tuple[genpy.Time, Event]]


class FailureRing:
    """Bounded in seconds and in bytes. Any thread may use it."""

    def __init__(self, settings: ReplaySettings) -> None:
        self._settings = settings

        def share(part: float) -> Tuple[float, int]:
            return settings.seconds, int(part * settings.most_bytes)

        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._images: TimedRing[KeptImage] = TimedRing(*share(IMAGE_SHARE))
        self._joints: TimedRing[KeptJoints] = TimedRing(*share(JOINT_SHARE))
        self._events: TimedRing[Tuple[genpy.Time, Event]] = TimedRing(*share(EVENT_SHARE))
        self._names: Dict[str, List[str]] = {}  # of joints by topic: samples share one list

    @property
    def bytes(self) -> int:
        """The bytes of all that is kept."""
        with self._lock:
            return self._images.bytes + self._joints.bytes + self._events.bytes

    def add_image(self, topic: str, came: genpy.Time, image: CompressedImage) -> None:
        """Keep a small image of one of the settings' cameras."""
        wire = len(image.data) + len(image.header.frame_id) + _OF_A_HEADER
        camera = self._settings.cameras.index(topic)
        with self._lock:
            kept = KeptImage(next(self._numbers), came, camera, image, wire)
            self._images.put(came.to_sec(), wire + _OF_AN_OBJECT, kept)

    def add_joints(self, topic: str, came: genpy.Time, joints: JointState) -> None:
        """Keep a joint state."""
        names = sum(4 + len(name) for name in joints.name)
        values = len(joints.position) + len(joints.velocity) + len(joints.effort)
        size = _OF_A_FLOAT * values + _OF_AN_OBJECT
        known = self._names.get(topic, [])
        if known != joints.name:  # several nodes may publish one topic, each in its own thread
            known = self._names[topic] = list(joints.name)
            size += names + _OF_A_NAME * len(joints.name)
        kept = JointState(joints.header, known, joints.position, joints.velocity, joints.effort)
        wire = names + 8 * values + len(joints.header.frame_id) + _OF_A_HEADER
        with self._lock:
            number = next(self._numbers)
            self._joints.put(came.to_sec(), size, KeptJoints(number, came, kept, wire))

    def add_event(self, came: genpy.Time, event: Event) -> None:
        """Keep an event."""
        texts = (event.path, event.state, event.outcome, event.target, event.text)
        size = sum(map(len, texts)) + _OF_AN_EVENT
        if event.data:
            size += len(json_of(event.data))
        with self._lock:
            self._events.put(came.to_sec(), size, (came, event))

    def freeze(self, at: genpy.Time) -> Before:
        """Return what is kept of the last seconds before a moment."""
        with self._lock:
            rings: Tuple[TimedRing, ...] = (self._images, self._joints, self._events)
            for ring in rings:
                ring.forget_before(at.to_sec())
            return Before(at, self._images.items(), self._joints.items(), self._events.items())

    def message(self, before: Before, event: Event) -> FailureReplay:
        """Make a message of what was kept, with the events of its trial.

        :param event: the failure, or the question where no failure led to it.
        """
        message = self.empty(before, event)
        fill(message, before.images, before.joints)
        message.events = [
            to_msg(each, came) for came, each in before.events if each.trial_id == event.trial_id
        ]
        return message

    def empty(self, before: Before, event: Event) -> FailureReplay:
        """Make a message with nothing in it but what it is about."""
        message = FailureReplay(
            trial_id=sendable_text(event.trial_id),
            seq=event.seq,
            seconds=self._settings.seconds,
            topics=list(self._settings.cameras),
        )
        message.header.stamp = before.at
        return message


def fill(message: FailureReplay, images: Sequence[KeptImage], joints: Sequence[KeptJoints]) -> None:
    """Put images and joint states into a message."""
    message.cameras = bytes(kept.camera for kept in images)
    message.images_came = [kept.came for kept in images]
    message.images = [kept.image for kept in images]
    message.joints_came = [kept.came for kept in joints]
    message.joints = [kept.joints for kept in joints]
