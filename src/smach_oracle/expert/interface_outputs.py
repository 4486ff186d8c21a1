"""What interfaces that robots have started print."""
import threading
from collections import OrderedDict
from typing import Any, Callable, Collection, Dict, Optional

from smach_oracle.msg import InterfaceOutput

from .robot_topics import MOST_ROBOTS, RobotTopics

_STATUS = {InterfaceOutput.STARTING: 'starting', InterfaceOutput.RUNNING: 'running', InterfaceOutput.FAILED: 'failed',
           InterfaceOutput.STOPPED: 'stopped'}
SHOWN_LINES = 60


class InterfaceOutputs:
    """Follows `<robot>/interface_output` of robots; holds the newest of each."""

    def __init__(self) -> None:
        self._topics = RobotTopics('/interface_output', InterfaceOutput, self.taker, queue_size=2)
        self._lock = threading.Lock()
        self._newest: 'OrderedDict[str, InterfaceOutput]' = OrderedDict()  # by robot

    def follow(self, robots: Collection[str]) -> None:
        """Listen to these robots, too."""
        self._topics.follow(robots)

    def view(self, query_id: str) -> Optional[Dict[str, Any]]:
        """What was printed for a question; None where nothing was started for it."""
        with self._lock:
            newest = list(self._newest.values())
        for message in newest:
            if message.query_id == query_id:
                return {'status': _STATUS.get(message.status, ''), 'text': message.text[:500],
                        'lines': list(message.lines[-SHOWN_LINES:])}
        return None

    def taker(self, robot: str) -> Callable[[InterfaceOutput], None]:
        """What takes in a robot's messages."""
        def take(message: InterfaceOutput) -> None:
            with self._lock:
                self._newest[robot] = message
                self._newest.move_to_end(robot)
                while len(self._newest) > MOST_ROBOTS:
                    self._newest.popitem(last=False)
        return take
