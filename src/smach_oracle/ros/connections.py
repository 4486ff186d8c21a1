"""Connections that are there, and those of which the other side surely knows."""
import time
from typing import Any, List, Sequence, Tuple

import rospy

SETTLE_S = 0.1
"""A publisher greets a new subscriber before it lists it among those that it sends to (rospy)."""


def live_connections(subscriber: rospy.Subscriber) -> List[Any]:
    """Its connections; without those whose socket is gone, which only wait to be made again."""
    if subscriber.impl is None:
        return []
    return [each for each in subscriber.impl.connections if getattr(each, 'socket', None) is not None]


class Settling:
    """Gives new connections their time; who asks once need not ask again."""

    def __init__(self) -> None:
        self._known: Tuple[Any, ...] = ()  # sockets: a connection that is made anew stays the same object

    def wait(self, connections: Sequence[Any]) -> None:
        """Return at once where all of these were there the last time, else after SETTLE_S."""
        sockets = tuple(each.socket for each in connections)
        if not all(any(each is known for known in self._known) for each in sockets):
            time.sleep(SETTLE_S)
        self._known = sockets
