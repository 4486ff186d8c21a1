"""Noticing that the action server that works on a goal is gone.

A server shows life by its status messages, about five a second. When they stop, or their connection
closes, the server's node is asked directly: a killed process is known within a fraction of a
second, and a server that is merely silent (a blocked callback queue, a paused simulation clock) is
not given up.
"""

import time
from typing import Any, Callable, List, Optional

import rospy

import smach
from smach_common import node_probe
from smach_common.connections import live_connections, sender_of

SILENT_AFTER_S = 2.0
"""Status messages missing for this long make us ask the node."""
PROBE_EVERY_S = 1.0
FROZEN_AFTER_S = 30.0
"""A node that neither sends status nor answers for this long is given up."""
WITHDRAWN_AFTER_S = 10.0
"""A node that answers, but has closed its status connection for this long, serves the action no
more.
"""


class ServerWatch(object):
    """Judges the server behind one status subscription. Thread-safe: plain attribute writes, one
    prober at a time.
    """

    def __init__(
        self,
        status_subscriber: Any,
        probe: Callable[..., None] = node_probe.probe_in_background,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._subscriber = status_subscriber
        self._probe = probe
        self._clock = clock
        self.server_id = ''
        self.status_count = 0
        self._server_uri = ''
        self._last_status_at = 0.0
        self._forget_suspicion()

    def _forget_suspicion(self) -> None:
        self._disconnected_since: Optional[float] = None
        self._unanswered_since: Optional[float] = None
        self._probing = False
        self._probed_at = float('-inf')
        self._gone = False
        self._said_silent = False

    def note_status(self, message: Any) -> None:
        """Take note of a status message. Call it for every one."""
        self.server_id = sender_of(message)
        self._last_status_at = self._clock()
        self.status_count += 1
        for connection in self.connections():
            self._server_uri = connection.endpoint_id
        if self._gone or self._said_silent or self._unanswered_since is not None:
            self._forget_suspicion()

    def connections(self) -> List[Any]:
        """Open connections to the server's status topic."""
        return [
            connection
            for connection in live_connections(self._subscriber)
            if connection.callerid_pub == self.server_id
        ]

    def problem(self, frozen_after_s: float = FROZEN_AFTER_S) -> Optional[str]:
        """Return why the server must be regarded as lost.

        None means that it lives, or that nothing is certain yet. It never blocks.
        """
        now = self._clock()
        connections = self.connections()
        if connections:
            self._disconnected_since = None
        elif self._disconnected_since is None:
            self._disconnected_since = now
        silent_s = now - self._last_status_at
        if connections and silent_s < SILENT_AFTER_S:
            return None
        self._ask_node(now)
        return self._judge(now, silent_s, frozen_after_s)

    def _judge(self, now: float, silent_s: float, frozen_after_s: float) -> Optional[str]:
        if self._gone:
            return 'its node %s is gone: nobody answers at %s' % (self.server_id, self._server_uri)
        if self._unanswered_since is not None and silent_s > frozen_after_s:
            return 'its node %s has given no sign of life for %.0f s' % (self.server_id, silent_s)
        disconnected = self._disconnected_since
        if disconnected is not None and now - disconnected > WITHDRAWN_AFTER_S:
            return (
                'node %s no longer serves the action: its status topic was closed' % self.server_id
            )
        if silent_s > 2 * SILENT_AFTER_S and not self._said_silent:
            self._said_silent = True
            smach.logwarn(
                'Action server on %s has sent no status for %.0f s; its goal is still awaited'
                % (self.server_id, silent_s)
            )
        return None

    def _ask_node(self, now: float) -> None:
        if self._probing or now - self._probed_at < PROBE_EVERY_S or not self._server_uri:
            return
        self._probing, self._probed_at = True, now
        asked_at = self._last_status_at
        self._probe(
            self._server_uri,
            rospy.get_caller_id(),
            lambda verdict: self._note_answer(verdict, asked_at),
        )

    def _note_answer(self, verdict: str, asked_at: float) -> None:
        self._probing = False
        if self._last_status_at != asked_at:
            return
        if verdict == node_probe.GONE:
            self._gone = True
        elif verdict == node_probe.ALIVE:
            self._unanswered_since = None
        elif self._unanswered_since is None:
            self._unanswered_since = self._clock()
