"""Other topics for the recorder: names worth recording, and their subscribers.

rospy has one subscriber per topic and process, of the type that came first: with rospy.AnyMsg, the
recorder would hand undecoded messages to the robot's own callbacks. So it subscribes with the true
type of a topic, and takes what comes.
"""

import threading
import time
from typing import Callable, Dict, List, Mapping, Optional, Sequence, Type

import genpy
import rosgraph
import rospy
from rospy.topics import get_topic_manager

from .bag_writer import MessageType
from .event_packing import serialise
from .recorder_queue import MessageItem, Moment, new_moment
from .trial_bag import ros_stamp_of

MessageClass = Type[genpy.Message]
LOOK_AGAIN_S = 0.5  # for the types of topics that nobody has advertised yet


def action_topics(server: str) -> List[str]:
    """Return the topics of an action server."""
    return [
        '{}/{}'.format(server, name) for name in ('goal', 'cancel', 'status', 'feedback', 'result')
    ]


def smach_topics(server: str) -> List[str]:
    """Return the topics of a SMACH introspection server."""
    return [
        '{}/smach/{}'.format(server, name) for name in ('container_structure', 'container_status')
    ]


def audit_topic(server: str) -> str:
    """Return the topic on which consoles publish the commands that people give.

    :param server: name of the expert query server that the commands are about.
    """
    return server + '/audit'


def now() -> Moment:
    """Return the present moment by both clocks."""
    return moment_at(time.time())


def moment_at(wall_time: float) -> Moment:
    """Return the present moment, whose wall time is known."""
    stamp = None
    if rospy.rostime.is_rostime_initialized():
        time_now = rospy.rostime.get_rostime()
        stamp = ros_stamp_of(time_now.secs, time_now.nsecs)
    return new_moment(stamp, wall_time, time.monotonic())


class TopicListener:
    """Subscribes to topics of any type, as soon as the type is known, and hands on each message."""

    def __init__(
        self,
        topics: Sequence[str],
        hand_on: Callable[[MessageItem], None],
        types: Optional[Mapping[str, MessageClass]] = None,
    ) -> None:
        """
        :param types: message classes of topics that nobody may have advertised yet, so that nothing
            is missed.
        """
        self._hand_on = hand_on
        self._unknown = list(dict.fromkeys(rospy.resolve_name(topic) for topic in topics))
        self._subscribers: List[rospy.Subscriber] = []
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._subscribe({**types_in_process(), **(types or {})})
        if self._unknown:
            threading.Thread(target=self._look, name='recorder topics', daemon=True).start()

    def _look(self) -> None:
        while self._unknown and not self._closing.is_set():
            try:
                self._subscribe({**types_at_master(), **types_in_process()})
            except (OSError, rosgraph.MasterException, ValueError):
                pass  # the master is away. It is asked again
            self._closing.wait(LOOK_AGAIN_S)

    def _subscribe(self, classes: Dict[str, MessageClass]) -> None:
        for topic in [topic for topic in self._unknown if topic in classes]:
            with self._lock:
                if self._closing.is_set():
                    return
                self._unknown.remove(topic)
                # No queue_size: it would be that of the robot's own subscriber of this topic, too.
                self._subscribers.append(
                    rospy.Subscriber(topic, classes[topic], self._received, callback_args=topic)
                )

    def _received(self, message: genpy.Message, topic: str) -> None:
        header = message._connection_header
        self._hand_on(
            MessageItem(
                topic,
                type_of(message),
                data_of(message),
                now(),
                header.get('latching') == '1',
                header.get('callerid', ''),
            )
        )

    def close(self) -> None:
        """Unsubscribe."""
        self._closing.set()
        with self._lock:
            subscribers, self._subscribers = self._subscribers, []
        for subscriber in subscribers:
            subscriber.unregister()


def types_in_process() -> Dict[str, MessageClass]:
    """Return the message classes of the topics of this process, by resolved name.

    It publishes or subscribes to them.
    """
    manager = get_topic_manager()
    with manager.lock:
        return {
            name: known.data_class
            for known_by_name in (manager.pubs, manager.subs)
            for name, known in known_by_name.items()
            if known.data_class is not None
        }


def types_at_master() -> Dict[str, MessageClass]:
    """Return the message classes of all topics that the master knows.

    AnyMsg stands for a class that is not installed here.

    :raises OSError, rosgraph.MasterException: where the master does not answer.
    """
    types = rosgraph.Master(rospy.get_name()).getTopicTypes()
    return {
        name: _class_of(type_name) or rospy.AnyMsg for name, type_name in types if type_name != '*'
    }


def _class_of(type_name: str) -> Optional[MessageClass]:
    try:
        return genpy.message.get_message_class(type_name)
    except (ValueError, ImportError):
        return None


def type_of(message: genpy.Message) -> MessageType:
    """Return the type of a received message, as a bag records it."""
    if not isinstance(message, rospy.AnyMsg):
        return MessageType(message._type, message._md5sum, message._full_text)
    header = message._connection_header
    return MessageType(header['type'], header['md5sum'], header.get('message_definition', ''))


def data_of(message: genpy.Message) -> bytes:
    """Return a received message as it was on the wire."""
    if isinstance(message, rospy.AnyMsg):
        return bytes(message._buff)
    return serialise(message)
