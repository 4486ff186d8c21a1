"""Connections of which the other side surely knows, or that rospy is closing."""

import http.client
import socket
import time
import xmlrpc.client
from contextlib import contextmanager
from typing import Any, Dict, Iterator, Optional, Sequence, Set, Tuple

import rospy

from smach_common.connections import Connection
from smach_common.node_probe import TimedTransport

GRACE_S = 0.1
"""For a publisher that cannot be asked whether it knows of a new connection."""

HANDSHAKE_S = 5.0
"""At most, for a publisher that can be asked: it may run on a busy machine."""

ASK_AGAIN_S = 0.01

TOPIC_ERRORS = (AttributeError, TypeError, rospy.ROSException)
"""What rospy raises where a topic is closed, or is being closed."""


@contextmanager
def quiet_at_shutdown() -> Iterator[None]:
    """Let the body publish. Nothing is raised where the node goes down meanwhile.

    rospy closes the topics before `rospy.is_shutdown` says so. Whoever publishes in between meets a
    closed topic, or one that is being taken apart.
    """
    try:
        yield
    except TOPIC_ERRORS:
        if not rospy.core.is_shutdown_requested():
            raise


class ConnectionGrace:
    """Gives new connections their time. Who asks once need not ask again.

    A publisher greets a new subscriber before it lists it among those that it sends to (rospy).
    What it sends in between is lost. So it is asked for its list.
    """

    def __init__(self) -> None:
        # sockets: a connection that is made again stays the same object
        self._known: Tuple[socket.socket, ...] = ()

    def wait(self, connections: Sequence[Connection]) -> None:
        """Wait until all of these are known, not at all where they were there the last time.

        :param connections: of subscribers of this node.
        """
        sockets = tuple(each.socket for each in connections)
        new = [
            each for each in connections if not any(each.socket is known for known in self._known)
        ]
        if new:
            _wait_until_known(new)
        self._known = sockets


def _wait_until_known(connections: Sequence[Connection]) -> None:
    """Wait until the publishers list all of these, cannot be asked, or take too long."""
    until = time.monotonic() + HANDSHAKE_S
    while time.monotonic() < until and not rospy.is_shutdown():
        lists: Dict[str, Optional[Set[str]]] = {}
        for uri in {getattr(each, 'endpoint_id', '') for each in connections}:
            lists[uri] = _topics_sent_by(uri)
        if None in lists.values():
            time.sleep(GRACE_S)
            return
        if all(each.name in (lists[each.endpoint_id] or ()) for each in connections):
            return
        time.sleep(ASK_AGAIN_S)


def _topics_sent_by(uri: str) -> Optional[Set[str]]:
    """The topics on which a node sends to this one, or None where it does not tell.

    :param uri: of the node's own server.
    """
    if not uri.startswith('http'):
        return None
    caller = rospy.get_caller_id()
    try:
        with xmlrpc.client.ServerProxy(uri, TimedTransport()) as node:
            answer: Any = node.getBusInfo(caller)
        code, _, listed = answer
        return (
            {each[4] for each in listed if each[1] == caller and each[2] == 'o'}
            if code == 1
            else None
        )
    except (
        OSError,
        xmlrpc.client.Error,
        http.client.HTTPException,
        ValueError,
        TypeError,
        IndexError,
    ):
        return None
