"""The audit of commands: in the log, on ~audit, and beside the expert query server in question."""

import json
import threading
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, Mapping, NamedTuple, Optional, Sequence, Tuple

import rospy

from smach_oracle.msg import ConsoleCommand
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.ros.event_messages import ros_now
from smach_oracle.ros.recording.recorder_topics import audit_topic

from ...followed_server import ListedQuestion

LONGEST_ARGUMENTS = 4000
MOST_WAITING = 100
LONGEST_WAIT_S = 10.0


class Person(NamedTuple):
    """The sender of a command."""

    client: str  # address of the browser
    session: str
    role: str
    expert: str


class AuditTopic(rospy.SubscribeListener):
    """A topic whose first subscriber also gets the records of the last seconds.

    Any thread may use it.

    A recorder takes its time to connect. A person who is quick must not go unrecorded.
    """

    def __init__(self, topic: str) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._stopped = False
        self._waiting: Deque[Tuple[float, ConsoleCommand]] = deque(maxlen=MOST_WAITING)
        self._publisher = rospy.Publisher(
            topic, ConsoleCommand, subscriber_listener=self, queue_size=1000
        )

    def publish(self, record: ConsoleCommand) -> None:
        """Publish a record, or keep it for the first subscriber."""
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

    def peer_subscribe(
        self, topic_name: str, topic_publish: Callable, peer_publish: Callable
    ) -> None:
        """Called by rospy for each new subscriber."""
        with self._lock:
            for said_s, record in self._waiting:
                if time.monotonic() - said_s < LONGEST_WAIT_S:
                    peer_publish(record)
            self._waiting.clear()


class Audit:
    """Publishes the records. Any thread may use it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._own = rospy.Publisher('~audit', ConsoleCommand, queue_size=1000)
        self._by_server: Dict[str, AuditTopic] = {}

    def prepare(self, servers: Sequence[str]) -> None:
        """Advertise beside these servers and no others.

        Done as soon as a server is known, a recorder is connected before the first command.
        """
        for server in servers:
            self._beside(server)
        with self._lock:
            gone = [self._by_server.pop(server) for server in set(self._by_server) - set(servers)]
        for topic in gone:
            topic.stop()

    def record(
        self,
        person: Person,
        command: str,
        ok: bool,
        message: str,
        arguments: Optional[Mapping[str, Any]] = None,
        listed: Optional[ListedQuestion] = None,
    ) -> None:
        """Record one command and its result."""
        record = ConsoleCommand(
            wall_time=time.time(),
            console=rospy.get_name(),
            client=person.client,
            session=person.session,
            role=person.role,
            expert=person.expert,
            command=command,
            ok=ok,
            message=shortened(message, 1000),
            arguments=json.dumps(arguments or {}, default=str)[:LONGEST_ARGUMENTS],
        )
        record.header.stamp = ros_now()
        if listed is not None:
            goal = listed.goal
            record.robot, record.trial_id = goal.robot, goal.trial_id
            record.query_id = goal.query_id
        rospy.loginfo(
            '%s of %s (%s, %s): %s%s',
            command,
            person.expert or 'nobody',
            person.role or 'no role',
            person.client,
            'done' if ok else 'refused',
            ': ' + repr(message) if message else '',
        )
        if rospy.is_shutdown():
            return
        self._own.publish(record)
        if listed is not None:
            self._beside(listed.server).publish(record)

    def _beside(self, server: str) -> AuditTopic:
        with self._lock:
            if server not in self._by_server:
                self._by_server[server] = AuditTopic(audit_topic(server))
            return self._by_server[server]
