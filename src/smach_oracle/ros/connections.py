"""Connections that are there, of which the other side surely knows, or that rospy is closing."""
import socket
import time
from contextlib import contextmanager
from typing import Iterator, List, Sequence, Tuple

import rospy
from rospy.impl.tcpros_base import TCPROSTransport as Connection

GRACE_S = 0.1
"""A publisher greets a new subscriber before it lists it among those that it sends to (rospy)."""

TOPIC_ERRORS = (AttributeError, TypeError, rospy.ROSException)
"""What rospy raises where a topic is closed, or is being closed."""


def live_connections(subscriber: rospy.Subscriber) -> List[Connection]:
    """Its connections; without those whose socket is gone, which only wait to be made again."""
    if subscriber.impl is None:
        return []
    return [
        each for each in subscriber.impl.connections if getattr(each, 'socket', None) is not None
    ]


@contextmanager
def quiet_at_shutdown() -> Iterator[None]:
    """Within it one publishes; nothing is raised where the node goes down meanwhile.

    rospy closes the topics before `rospy.is_shutdown` says so. Whoever publishes in between meets a
    closed topic, or one that is being taken apart.
    """
    try:
        yield
    except TOPIC_ERRORS:
        if not rospy.core.is_shutdown_requested():
            raise


class ConnectionGrace:
    """Gives new connections their time; who asks once need not ask again."""

    def __init__(self) -> None:
        # sockets: a connection that is made anew stays the same object
        self._known: Tuple[socket.socket, ...] = ()

    def wait(self, connections: Sequence[Connection]) -> None:
        """Return at once where all of these were there the last time, else after GRACE_S."""
        sockets = tuple(each.socket for each in connections)
        if not all(any(each is known for known in self._known) for each in sockets):
            time.sleep(GRACE_S)
        self._known = sockets
