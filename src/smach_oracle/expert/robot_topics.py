"""Topics of the robots that ask."""

import threading
from collections import OrderedDict
from typing import Any, Callable, Collection

import rosgraph
import rosgraph.names

from smach_oracle.ros.senders.own_messages import subscribe_to_owner

MOST_ROBOTS = 64
# Read at a time. Each connection waits with a buffer of so many, and cuts it to what came. With
# rospy's 64 KiB the rests come to lie all over the heap: a console of ten robots grew by 20 MB.
READ_BYTES = 4096
_MASTER_PERIOD_S = 0.5


class RobotTopic:
    """One topic of one robot, subscribed to in a thread of its own once there is a master.

    Without a master rospy would not come back from subscribing, and would hold a lock without which
    the node cannot even shut down.
    """

    def __init__(
        self,
        robot: str,
        topic: str,
        kind: type,
        take: Callable[[Any], None],
        queue_size: int = 100,
        buff_size: int = READ_BYTES,
    ) -> None:
        """
        :param robot: a node's name, as given in a question. A name that ROS forbids is ignored.
        :param topic: behind the robot's name, such as /oracle/events.
        :param take: called with each message.
        """
        self._stopped = threading.Event()
        self._subscribe = lambda: subscribe_to_owner(
            robot + topic, kind, take, queue_size=queue_size, buff_size=buff_size, tcp_nodelay=True
        )
        if is_node_name(robot):
            threading.Thread(target=self._listen, name='listen to ' + robot, daemon=True).start()

    def stop(self) -> None:
        """Listen no longer."""
        self._stopped.set()

    def _listen(self) -> None:
        while not rosgraph.is_master_online():
            if self._stopped.wait(_MASTER_PERIOD_S):
                return
        if self._stopped.is_set():
            return
        subscriber = self._subscribe()
        self._stopped.wait()
        subscriber.unregister()


class RobotTopics:
    """The same topic of many robots: of those that asked last. One thread calls it."""

    def __init__(
        self,
        topic: str,
        kind: type,
        taker: Callable[[str], Callable[[Any], None]],
        queue_size: int,
        buff_size: int = READ_BYTES,
    ) -> None:
        """
        :param topic: behind the robot's name, such as /oracle/preconditions.
        :param taker: returns the function that takes the messages of a robot.
        """
        self._listen_to = lambda robot: RobotTopic(
            robot, topic, kind, taker(robot), queue_size, buff_size
        )
        self._topics: 'OrderedDict[str, RobotTopic]' = OrderedDict()

    def follow(self, robots: Collection[str]) -> None:
        """Listen to these robots, too.

        Names that ROS forbids are ignored, as anybody may put a question under any name. Where
        there is not room for all, the robots go that have asked nothing for longest.
        """
        asking = [robot for robot in dict.fromkeys(robots) if is_node_name(robot)]
        for robot in asking[:MOST_ROBOTS]:
            if robot not in self._topics:
                self._topics[robot] = self._listen_to(robot)
            self._topics.move_to_end(robot)
        while len(self._topics) > MOST_ROBOTS:
            self._topics.popitem(last=False)[1].stop()

    def stop(self) -> None:
        """Listen to no robot any longer."""
        while self._topics:
            self._topics.popitem()[1].stop()


def is_node_name(robot: str) -> bool:
    """Whether a node may have this name."""
    return bool(robot and rosgraph.names.is_legal_name(robot))
