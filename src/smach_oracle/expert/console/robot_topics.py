"""One topic of each robot that asks, listened to as long as the robot is among those that asked last."""
from collections import OrderedDict
from typing import Any, Callable, Collection

import rosgraph.names
import rospy

MOST_ROBOTS = 64


class RobotTopics:
    """`follow` is called by one thread."""

    def __init__(self, topic: str, kind: type, taker: Callable[[str], Callable[[Any], None]], **options: Any) -> None:
        """
        :param topic: behind the robot's name, such as /oracle/preconditions.
        :param taker: gives what takes in the messages of a robot.
        :param options: of rospy.Subscriber.
        """
        self._topic = topic
        self._kind = kind
        self._taker = taker
        self._options = options
        self._subscribers: 'OrderedDict[str, rospy.Subscriber]' = OrderedDict()

    def follow(self, robots: Collection[str]) -> None:
        """Listen to these, too: names of nodes, anybody's word; what is none is left out. Of more robots than there is
        room for, those go that have asked nothing for longest."""
        asking = [robot for robot in dict.fromkeys(robots) if robot and rosgraph.names.is_legal_name(robot)]
        for robot in asking[:MOST_ROBOTS]:
            if robot not in self._subscribers:
                self._subscribers[robot] = rospy.Subscriber(robot + self._topic, self._kind, self._taker(robot),
                                                            **self._options)
            self._subscribers.move_to_end(robot)
        while len(self._subscribers) > MOST_ROBOTS:
            self._subscribers.popitem(last=False)[1].unregister()
