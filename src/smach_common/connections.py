"""Who is at the other end of a topic: connections that are there, and whose message it is."""

from typing import Any, List, Optional

import rospy
from rospy.impl.tcpros_base import TCPROSTransport as Connection


def sender_of(message: Any) -> str:
    """Return the node that has sent a message, '' where that is not known."""
    return str((getattr(message, '_connection_header', None) or {}).get('callerid', ''))


def live_connections(subscriber: rospy.Subscriber) -> List[Connection]:
    """Return its connections, without those whose socket is gone.

    The latter only wait to be made again.
    """
    if subscriber.impl is None:
        return []
    return [
        each for each in subscriber.impl.connections if getattr(each, 'socket', None) is not None
    ]


def connection_from(subscriber: rospy.Subscriber, node: str) -> Optional[Connection]:
    """Return the live connection on which a node's messages come, or None."""
    return next((each for each in live_connections(subscriber) if each.callerid_pub == node), None)


def reaches(publisher: rospy.Publisher, node: str) -> bool:
    """Whether a living node of that name listens.

    rospy looks only now and then whether one has died. One that was started again under its name
    would seem to be there before it listens.
    """
    topic = publisher.impl
    if topic is None:
        return False
    topic.check()
    return bool(topic.has_connection(node))
