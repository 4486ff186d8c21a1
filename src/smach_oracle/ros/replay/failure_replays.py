"""Keeps the last seconds of a robot, for the question that a failure leads to and for the bag.

The robot's node keeps them, for it is there in every trial, recorded or not, with or without a
console. Callbacks only choose what is kept. One thread makes images small and publishes.
"""

import threading
import time
from collections import OrderedDict, deque
from typing import Callable, Deque, Dict, Optional, Tuple

import genpy
import rospy
from sensor_msgs.msg import JointState

from smach_oracle.forking import in_child
from smach_oracle.msg import FailureReplay
from smach_oracle.oracle.records.events import Event, EventKind, EventSource, OwnObserver

from ..connections import quiet_at_shutdown
from ..log.said_once import warn_once
from .bag_quota import BagQuota
from .failure_ring import Before, FailureRing
from .known_topics import KnownTopics
from .replay_settings import CAMERA_TYPES, ReplaySettings, read_settings
from .small_images import CameraMessage, small_jpeg

TOPIC = '~failure_replay'
JOINTS_PERIOD_S = 0.2  # ROS time
NEARLY = 0.99  # of the period: stamps are rounded
# Simulated time may run many times faster than the wall's. This bounds what the ring costs then.
WALL_SHARE = 0.2  # of the period, in wall time
MOST_TRIALS = 32  # whose failures and quotas are known
MOST_SOURCES = 64  # of joint states
MOST_WAITING = 4  # messages

PutIntoBag = Callable[[str, str, FailureReplay], None]  # trial id, topic, message


class Pace:
    """Thins out streams: of each, one message in a period of ROS time."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._last: Dict[str, Tuple[float, float]] = {}

    def takes(self, source: str, now_s: float, wall_s: float) -> bool:
        """Whether a message that has come now is kept.

        :param now_s: ROS time.
        :param wall_s: monotonic.
        """
        last_s, last_wall_s = self._last.get(source, (-self._period_s, wall_s - self._period_s))
        is_due = (
            not 0 <= now_s - last_s < NEARLY * self._period_s
        )  # also where the clock has jumped back
        if not is_due or wall_s - last_wall_s < WALL_SHARE * self._period_s:
            return False
        if len(self._last) >= MOST_SOURCES and source not in self._last:
            self._last.clear()
        self._last[source] = now_s, wall_s
        return True


class _ReplayedTrial:
    def __init__(self, bag_bytes: int) -> None:
        self.failure: Optional[Tuple[Before, Event]] = None  # the latest
        self.quota = BagQuota(bag_bytes)


class FailureReplays(OwnObserver):
    """The ring of a node, which is an observer of its machines."""

    observer_name = 'the replay of failures'
    without_it = 'it is not in the replay'

    def __init__(self, settings: ReplaySettings, put_into_bag: PutIntoBag) -> None:
        """Subscribe to the topics of the settings as soon as they are advertised.

        :param put_into_bag: called in the machine's thread, with what the bag of a trial gets.
        """
        self._settings = settings
        self._put_into_bag = put_into_bag
        self._ring = FailureRing(settings)
        self._image_pace = Pace(1.0 / settings.rate)
        self._joint_pace = Pace(JOINTS_PERIOD_S)
        self._trials: 'OrderedDict[str, _ReplayedTrial]' = OrderedDict()
        self._changed = threading.Condition()
        # the newest image of each camera that is not small yet
        self._images: Dict[str, Tuple[genpy.Time, CameraMessage]] = {}
        self._questions: Deque[Tuple[Before, Event, str]] = deque(maxlen=MOST_WAITING)
        self._is_parents = False
        self._topic = rospy.resolve_name(TOPIC)
        self._publisher = rospy.Publisher(TOPIC, FailureReplay, latch=True, queue_size=5)
        self._listening = (
            KnownTopics(settings.cameras, CAMERA_TYPES, self._take_image, 'replay cameras'),
            KnownTopics(
                settings.joints, {JointState._type: JointState}, self._take_joints, 'replay joints'
            ),
        )
        threading.Thread(target=self._work, name='replay of failures', daemon=True).start()
        in_child(self._let_go)

    def _let_go(self) -> None:
        self._is_parents = True  # a child hears no topics, and the bag is its parent's

    def watch(self, source: EventSource) -> None:
        """Observe a machine's events. Twice is once."""
        if self not in source.observers:
            source.observers.append(self)

    def __call__(self, event: Event) -> None:
        """Take in an event. At a failure, put what was kept into the bag."""
        if self._is_parents:
            return
        now = rospy.get_rostime()
        self._ring.add_event(now, event)
        if event.kind == EventKind.FAILURE:
            self._note_failure(now, event)
        elif event.kind == EventKind.QUERY_OPENED:
            with self._changed:
                self._questions.append((*self._before(now, event), event.query_id))
                self._changed.notify()
        elif event.kind == EventKind.TRIAL_END:
            self._trials.pop(event.trial_id, None)

    def _trial(self, trial_id: str) -> _ReplayedTrial:
        if trial_id not in self._trials:
            self._trials[trial_id] = _ReplayedTrial(self._settings.bag_bytes)
            while len(self._trials) > MOST_TRIALS:
                self._trials.popitem(last=False)
        return self._trials[trial_id]

    def _note_failure(self, now: genpy.Time, event: Event) -> None:
        before = self._ring.freeze(now)
        trial = self._trial(event.trial_id)
        trial.failure = before, event
        if self._settings.bag_bytes:
            message = trial.quota.message(before, lambda: self._ring.empty(before, event))
            if message is not None:
                self._put_into_bag(event.trial_id, self._topic, message)

    def _before(self, now: genpy.Time, event: Event) -> Tuple[Before, Event]:
        """What was kept at the failure that led to a question, else what is kept now."""
        trial = self._trials.get(event.trial_id)
        if trial is not None and trial.failure is not None:
            age_s = (now - trial.failure[0].at).to_sec()
            if 0 <= age_s <= self._settings.seconds:
                return trial.failure
        return self._ring.freeze(now), event

    def _take_image(self, message: CameraMessage, topic: str) -> None:
        now = rospy.get_rostime()
        if self._image_pace.takes(topic, now.to_sec(), time.monotonic()):
            with self._changed:
                self._images[topic] = now, message
                self._changed.notify()

    def _take_joints(self, message: JointState, topic: str) -> None:
        now = rospy.get_rostime()
        # several nodes may take turns in publishing joints of their own
        source = '{} {}'.format(topic, getattr(message, '_connection_header', {}).get('callerid'))
        if self._joint_pace.takes(source, now.to_sec(), time.monotonic()):
            self._ring.add_joints(topic, now, message)

    def _work(self) -> None:
        while not rospy.is_shutdown():
            with self._changed:
                if not self._images and not self._questions:
                    self._changed.wait()
                images, self._images = self._images, {}
                questions = list(self._questions)
                self._questions.clear()
            for topic, (came, message) in images.items():
                self._make_small(topic, came, message)
            for before, event, query_id in questions:
                self._publish(before, event, query_id)

    def _make_small(self, topic: str, came: genpy.Time, message: CameraMessage) -> None:
        try:
            self._ring.add_image(topic, came, small_jpeg(message, self._settings.width))
        except ValueError as err:
            warn_once(
                'An image of {} is not in the replay of failures: {}. This is said once'.format(
                    topic, err
                ),
                topic,
            )
        except Exception as err:  # OpenCV raises what it likes, and the next image may be sound
            warn_once('An image of {} cannot be made small: {!r}'.format(topic, err), topic)

    def _publish(self, before: Before, event: Event, query_id: str) -> None:
        message = self._ring.message(before, event)
        message.query_id = query_id
        with quiet_at_shutdown():
            self._publisher.publish(message)


def replays_of_node(put_into_bag: PutIntoBag) -> Optional[FailureReplays]:
    """Return the ring of this node, or None where its parameters name nothing to keep.

    :raises SettingsError: naming the parameter whose value is invalid.
    """
    settings = read_settings()
    return FailureReplays(settings, put_into_bag) if settings.on else None
