"""What interfaces that robots have started print."""
from typing import Any, Dict, Iterable, Optional

import rosgraph.names
import rospy

from smach_oracle.msg import InterfaceOutput

_STATUS = {InterfaceOutput.STARTING: 'starting', InterfaceOutput.RUNNING: 'running', InterfaceOutput.FAILED: 'failed',
           InterfaceOutput.STOPPED: 'stopped'}
SHOWN_LINES = 60
MOST_ROBOTS = 64


class InterfaceOutputs:
    """Follows `<robot>/interface_output` of robots; holds the newest of each."""

    def __init__(self) -> None:
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        self._newest: Dict[str, InterfaceOutput] = {}  # by robot

    def follow(self, robots: Iterable[str]) -> None:
        """Listen to these robots, too."""
        for robot in robots:
            if robot and robot not in self._subscribers and rosgraph.names.is_legal_name(robot) \
                    and len(self._subscribers) < MOST_ROBOTS:
                self._subscribers[robot] = rospy.Subscriber(robot + '/interface_output', InterfaceOutput, self._take,
                                                            callback_args=robot, queue_size=2)

    def view(self, query_id: str) -> Optional[Dict[str, Any]]:
        """What was printed for a question; None where nothing was started for it."""
        for message in list(self._newest.values()):
            if message.query_id == query_id:
                return {'status': _STATUS.get(message.status, ''), 'text': message.text[:500],
                        'lines': list(message.lines[-SHOWN_LINES:])}
        return None

    def stop(self) -> None:
        """Listen no longer."""
        for subscriber in self._subscribers.values():
            subscriber.unregister()

    def _take(self, message: InterfaceOutput, robot: str) -> None:
        self._newest[robot] = message
