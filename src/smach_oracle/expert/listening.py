"""Listens to a topic of a robot, in a thread of its own."""
import threading
from typing import Any, Callable

import rosgraph
import rosgraph.names
import rospy

_MASTER_PERIOD_S = 0.5


class RobotListener:
    """One subscription, begun aside and not before the master is there: until then rospy would not come back from
    subscribing, and would hold a lock without which the node cannot even shut down."""

    def __init__(self, robot: str, topic: str, kind: type, take: Callable[[Any], None]) -> None:
        """`robot`: a node's name; anybody may put a question under any, and one that is none is not listened to."""
        self._stopped = threading.Event()
        self._kind = kind
        self._take = take
        if robot and rosgraph.names.is_legal_name(robot):
            threading.Thread(target=self._listen, args=(robot + topic,), name='listen to ' + robot,
                             daemon=True).start()

    def stop(self) -> None:
        """Listen no longer."""
        self._stopped.set()

    def _listen(self, topic: str) -> None:
        while not rosgraph.is_master_online():
            if self._stopped.wait(_MASTER_PERIOD_S):
                return
        subscriber = rospy.Subscriber(topic, self._kind, self._take, queue_size=100, tcp_nodelay=True)
        self._stopped.wait()
        subscriber.unregister()
