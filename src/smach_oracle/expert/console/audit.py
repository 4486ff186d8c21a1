"""Every command that a browser gives is told: to the log, on ~audit, and to the recorder of the robot it is about."""
import json
import threading
import time
from typing import Any, Dict, Mapping, NamedTuple, Optional, Sequence

import rospy

from smach_oracle.msg import ConsoleCommand

from ...ros.event_messages import ros_now
from ...ros.recorder_topics import audit_topic
from ..followed_server import Listed

LONGEST_ARGUMENTS = 4000


class Person(NamedTuple):
    """Who gives a command."""

    client: str  # address of the browser
    session: str
    role: str
    expert: str


class Audit:
    """The publishers; any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._own = rospy.Publisher('~audit', ConsoleCommand, queue_size=1000)
        self._by_server: Dict[str, rospy.Publisher] = {}

    def prepare(self, servers: Sequence[str]) -> None:
        """Advertise beside servers as soon as they are known, so that recorders are connected before the first
        command."""
        for server in servers:
            with self._lock:
                if server not in self._by_server:
                    self._by_server[server] = rospy.Publisher(audit_topic(server), ConsoleCommand, queue_size=1000)

    def tell(self, person: Person, command: str, ok: bool, message: str, arguments: Optional[Mapping[str, Any]] = None,
             listed: Optional[Listed] = None) -> None:
        """Tell of one command and of what came of it."""
        record = ConsoleCommand(
            wall_time=time.time(), console=rospy.get_name(), client=person.client, session=person.session,
            role=person.role, expert=person.expert, command=command, ok=ok, message=message[:1000],
            arguments=json.dumps(arguments or {}, default=str)[:LONGEST_ARGUMENTS])
        record.header.stamp = ros_now()
        if listed is not None:
            goal = listed.goal
            record.robot, record.trial_id, record.query_id = goal.robot, goal.trial_id, goal.query_id
        rospy.loginfo('%s of %s (%s, %s): %s%s', command, person.expert or 'nobody', person.role or 'no role',
                      person.client, 'done' if ok else 'refused', ': ' + repr(message) if message else '')
        if rospy.is_shutdown():
            return
        self._own.publish(record)
        if listed is not None:
            self.prepare([listed.server])
            self._by_server[listed.server].publish(record)
