"""The printed output of the interfaces that robots have started."""

import threading
from collections import OrderedDict
from typing import Callable, Collection, Optional

from smach_oracle.msg import InterfaceOutput

from .robot_topics import MOST_ROBOTS, RobotTopics

TOPIC = '/interface_output'  # behind the robot's name


class InterfaceOutputs:
    """Follows `<robot>/interface_output` of robots and holds the newest one for each question."""

    def __init__(self, query_id: str = '') -> None:
        """`query_id`: of the only question whose interface is followed. '' follows all."""
        self._query_id = query_id
        self._topics = RobotTopics(TOPIC, InterfaceOutput, self.taker, queue_size=5)
        self._lock = threading.Lock()
        self._newest: 'OrderedDict[str, InterfaceOutput]' = OrderedDict()  # by question

    def follow(self, robots: Collection[str]) -> None:
        """Listen to these robots, too."""
        self._topics.follow(robots)

    def newest(self, query_id: str) -> Optional[InterfaceOutput]:
        """Return the newest message about a question, or None where nothing was started for it."""
        with self._lock:
            return self._newest.get(query_id)

    def stop(self) -> None:
        """Listen to no robot any longer."""
        self._topics.stop()

    def taker(self, _robot: str) -> Callable[[InterfaceOutput], None]:
        """Return the function that takes a robot's messages."""
        return self._take

    def _take(self, message: InterfaceOutput) -> None:
        if self._query_id not in ('', message.query_id):
            return
        with self._lock:
            self._newest[message.query_id] = message
            self._newest.move_to_end(message.query_id)
            while len(self._newest) > MOST_ROBOTS:
                self._newest.popitem(last=False)
