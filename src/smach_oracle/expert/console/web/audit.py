"""Every command that a browser gives is told: to the log, on ~audit, and to the recorder of the robot it is about."""
import json
import threading
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, Mapping, NamedTuple, Optional, Sequence, Tuple

import rospy

from smach_oracle.msg import ConsoleCommand

from ...ros.event_messages import ros_now
from ...ros.recorder_topics import audit_topic
from ..followed_server import Listed

LONGEST_ARGUMENTS = 4000
MOST_WAITING = 100
LONGEST_WAIT_S = 10.0


class Person(NamedTuple):
    """Who gives a command."""

    client: str  # address of the browser
    session: str
    role: str
    expert: str


class Told(rospy.SubscribeListener):
    """A topic whose first listener hears also what was said in the last seconds before it came; any thread.

    A recorder takes its time to connect; a person who is quick must not go unrecorded.
    """

    def __init__(self, topic: str) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._stopped = False
        self._waiting: Deque[Tuple[float, ConsoleCommand]] = deque(maxlen=MOST_WAITING)
        self._publisher = rospy.Publisher(topic, ConsoleCommand, subscriber_listener=self, queue_size=1000)

    def tell(self, record: ConsoleCommand) -> None:
        """Publish it, or keep it for who comes first."""
        with self._lock:
            if self._stopped:
                return
            if self._publisher.get_num_connections():
                self._publisher.publish(record)
            else:
                self._waiting.append((time.monotonic(), record))

    def stop(self) -> None:
        """Take the topic down."""
        with self._lock:
            self._stopped = True
        self._publisher.unregister()

    def peer_subscribe(self, topic_name: str, topic_publish: Callable, peer_publish: Callable) -> None:
        """Called by rospy for each listener that has come."""
        with self._lock:
            for said_s, record in self._waiting:
                if time.monotonic() - said_s < LONGEST_WAIT_S:
                    peer_publish(record)
            self._waiting.clear()


class Audit:
    """The publishers; any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._own = rospy.Publisher('~audit', ConsoleCommand, queue_size=1000)
        self._by_server: Dict[str, Told] = {}

    def prepare(self, servers: Sequence[str]) -> None:
        """Advertise beside servers as soon as they are known, so that recorders are connected before the first
        command; beside those that are followed no longer not any more."""
        for server in servers:
            self._beside(server)
        with self._lock:
            gone = [self._by_server.pop(server) for server in set(self._by_server) - set(servers)]
        for told in gone:
            told.stop()

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
            self._beside(listed.server).tell(record)

    def _beside(self, server: str) -> Told:
        with self._lock:
            if server not in self._by_server:
                self._by_server[server] = Told(audit_topic(server))
            return self._by_server[server]
