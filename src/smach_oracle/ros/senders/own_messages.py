"""Whose message it is: a bag may be played beside the robot that it is of.

A player publishes under the robot's names. It listens to nothing, and it serves nothing.
"""

from typing import Any, Callable, Iterable, List, Set, Tuple, Type

import genpy
import rospy
from rospy.topics import get_topic_manager

from smach_common.connections import sender_of

Take = Callable[[Any], None]

LISTENS_AFTER_S = 0.5  # a node may be connected a moment before this one knows it


def owner_of(topic: str, nodes: Iterable[str]) -> str:
    """Return the node that a topic belongs to, '' where nobody publishes it.

    It is the node after which the topic is named. Else it is the one that was there first, as the
    topic may be relayed.

    :param nodes: publish it, the one that was there first in front.
    """
    publishers = list(nodes)
    named = [node for node in publishers if is_named_after(topic, node)]
    return max(named, key=len) if named else next(iter(publishers), '')


def is_named_after(topic: str, node: str) -> bool:
    """Whether a topic lies in the private namespace of a node."""
    return bool(node) and topic.startswith(node.rstrip('/') + '/')


def publishers_of(topic: str) -> List[str]:
    """Return the nodes from which this process hears a topic now, the first one in front."""
    implementation = get_topic_manager().subs.get(topic)
    connections = implementation.connections if implementation is not None else ()
    return [
        str(getattr(each, 'callerid_pub', ''))
        for each in connections
        if getattr(each, 'socket', None) is not None
    ]


_named: Set[Tuple[str, str]] = set()  # who was named in the log, and the owner of the topics


class OwnMessages:
    """Hands on the messages of the node that a topic belongs to. The others are named once."""

    def __init__(self, topic: str, take: Take) -> None:
        """`topic`: resolved."""
        self._topic = topic
        self._take = take

    def __call__(self, message: genpy.Message) -> None:
        """Take a message. This is rospy's callback."""
        node, owner = sender_of(message), owner_of(self._topic, publishers_of(self._topic))
        if not owner or node in ('', owner):
            self._take(message)
        elif (node, owner) not in _named:
            _named.add((node, owner))
            rospy.logwarn(
                '%s publishes on topics of %s, such as %s: its messages are ignored. A '
                'bag that is played beside the robot does that',
                node,
                owner,
                self._topic,
            )


def subscribe_to_owner(
    topic: str, kind: Type[genpy.Message], take: Take, **options: Any
) -> rospy.Subscriber:
    """Return a subscriber that takes the messages of the node that the topic belongs to."""
    return rospy.Subscriber(topic, kind, OwnMessages(rospy.resolve_name(topic), take), **options)


def listens(publisher: rospy.Publisher, node: str) -> bool:
    """Whether a node listens to what this one publishes there."""
    return node in _listeners(publisher)


def others_listen(publisher: rospy.Publisher) -> bool:
    """Whether a node other than this one listens to what this one publishes there."""
    return bool(_listeners(publisher) - {rospy.get_name()})


def _listeners(publisher: rospy.Publisher) -> Set[str]:
    implementation = publisher.impl
    connections = [] if implementation is None else list(implementation.connections)
    return {getattr(each, 'endpoint_id', '') for each in connections}
