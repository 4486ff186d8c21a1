"""Finding introspection servers and telling their containers where to start."""

import threading
import time
from typing import Any, List, Optional, Sequence

import rospy

import smach
from smach_common.introspection.introspection_server import INIT_TOPIC, STATUS_TOPIC
from smach_common.introspection.plain_pickle import encode_userdata
from smach_msgs.msg import SmachContainerInitialStatusCmd, SmachContainerStatus
from smach_ros.waiting import deadline_after, seconds, shutting_down

REPEAT_COMMAND_S = 2.0
LOOK_S = 0.02


class IntrospectionClient(object):
    """Talks to the introspection servers of this master."""

    def get_servers(self) -> List[str]:
        """Return the names of all servers that publish now.

        It raises what rospy raises if the master does not answer.
        """
        return sorted(
            topic[: -len(STATUS_TOPIC)]
            for topic, kind in rospy.get_published_topics()
            if kind == SmachContainerStatus._type and topic.endswith(STATUS_TOPIC)
        )

    def set_initial_state(
        self,
        server: str,
        path: str,
        initial_states: Sequence[str],
        initial_userdata: Any = None,
        timeout: Any = None,
    ) -> bool:
        """Let the container at ``path`` start in ``initial_states``, with ``initial_userdata``
        (UserData) added.

        Waits until the server confirms, at most ``timeout`` (``rospy.Duration`` or seconds of wall
        time, None means without end). Returns whether it did.

        :raises InvalidUserCodeError: for userdata that cannot be sent.
        """
        command = SmachContainerInitialStatusCmd(
            path, list(initial_states), _encode_strictly(initial_userdata)
        )
        return _Command(server, command).send(deadline_after(seconds(timeout)))


def _encode_strictly(userdata: Any) -> str:
    def refuse(key: str, err: Exception) -> None:
        raise smach.InvalidUserCodeError(
            "Userdata key '%s' cannot be sent: %s" % (key, err)
        ) from err

    return encode_userdata({} if userdata is None else userdata._data, refuse)


class _Command(object):
    """One command, repeated until the container's status confirms it."""

    def __init__(self, server: str, command: SmachContainerInitialStatusCmd) -> None:
        self._server = server
        self._command = command
        self._confirmed = threading.Event()

    def send(self, deadline: Optional[float]) -> bool:
        publisher = rospy.Publisher(
            self._server + INIT_TOPIC, SmachContainerInitialStatusCmd, queue_size=1
        )
        subscriber = rospy.Subscriber(
            self._server + STATUS_TOPIC, SmachContainerStatus, self._on_status
        )
        try:
            return self._repeat(publisher, subscriber, deadline)
        finally:
            publisher.unregister()
            subscriber.unregister()

    def _repeat(
        self, publisher: rospy.Publisher, subscriber: rospy.Subscriber, deadline: Optional[float]
    ) -> bool:
        send_at = 0.0
        while not shutting_down() and (deadline is None or time.monotonic() < deadline):
            # Without the status topic we would miss the confirmation, and send a running machine
            # there twice.
            connected = publisher.get_num_connections() and subscriber.get_num_connections()
            if connected and time.monotonic() >= send_at:
                publisher.publish(self._command)
                send_at = time.monotonic() + REPEAT_COMMAND_S
            if self._confirmed.wait(LOOK_S):
                return True
        return False

    def _on_status(self, status: SmachContainerStatus) -> None:
        if (
            status.path == self._command.path
            and status.info == 'REMOTE_INIT'
            and set(status.initial_states) == set(self._command.initial_states)
        ):
            self._confirmed.set()
