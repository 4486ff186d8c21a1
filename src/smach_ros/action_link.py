"""One connection to an action server, shared by all states of the process that use the action.

A link lives as long as the process: states come and go (and machines are executed hundreds of
times) without opening topics or threads again.
"""

import _thread
import threading
import time
import weakref
from typing import Any, Callable, Dict, List, Optional, Tuple

import actionlib
import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatusArray

import smach
from smach_ros.server_watch import ServerWatch
from smach_ros.waiting import shutting_down

RETRY_CONNECT_S = 0.5
SETTLE_S = 0.05
"""A server greets a new subscriber before it puts it on the list of those that get its results
(rospy).
"""
SEND_CANCEL_S = 0.1
"""Time for rospy's sender threads to put a cancel on the wire before the node closes its topics."""

_links: Dict[Tuple[str, Any], 'ActionLink'] = {}
_links_lock = threading.Lock()


def link_to(action_name: str, action_spec: Any) -> 'ActionLink':
    """Return the process's link to the action.

    The first call for it opens the link in the background.
    """
    key = (rospy.resolve_name(action_name), action_spec)
    with _links_lock:
        if not _links:
            rospy.on_shutdown(_cancel_all)
        if key not in _links:
            _links[key] = ActionLink(action_name, action_spec)
        return _links[key]


def _cancel_all() -> None:
    """At a shutdown: cancel the goals under way while the topics are still open.

    From another thread, as Ctrl-C may have interrupted the executing one while it held a lock that
    is needed here.
    """
    runs = [run for link in list(_links.values()) for run in list(link.active_runs)]
    if runs:
        # not a Thread: Ctrl-C may have interrupted threading, too
        _thread.start_new_thread(lambda: [run.cancel() for run in runs], ())
        time.sleep(2 * SEND_CANCEL_S)


class ActionLink(object):
    """Topics of one action: opened in the background, as soon as the node is initialised and its
    master answers.
    """

    # actionlib counts its goals without one: two at once could get the same id
    _sending = threading.Lock()

    def __init__(self, action_name: str, action_spec: Any) -> None:
        self.action_name = action_name
        self.client: Optional[actionlib.ActionClient] = None
        self.watch: Optional[ServerWatch] = None
        self.active_runs: 'weakref.WeakSet[Any]' = weakref.WeakSet()
        self._spec = action_spec
        self._fast_ends: List[Any] = []
        self._seen: Tuple[Any, ...] = ()
        self._seen_at = 0.0
        threading.Thread(target=self._connect, name='connect %s' % action_name, daemon=True).start()

    def _connect(self) -> None:
        complained = False
        while not shutting_down():
            try:
                # without a master rospy would hold a lock here that a shutdown of the node waits
                # for
                if rospy.core.is_initialized() and rosgraph.is_master_online():
                    self._open()
                    return
            except (OSError, rospy.ROSException) as err:
                if not complained:
                    smach.logwarn(
                        "Cannot open action '%s' yet, trying on: %s" % (self.action_name, err)
                    )
                complained = True
            time.sleep(RETRY_CONNECT_S if complained else 0.05)

    def _open(self) -> None:
        self._disable_nagle()
        client = actionlib.ActionClient(self.action_name, self._spec)
        watch = ServerWatch(client.status_sub)
        self._fast_ends.append(
            rospy.Subscriber(client.status_sub.name, GoalStatusArray, watch.note_status)
        )
        self.watch = watch
        self.client = client

    def _disable_nagle(self) -> None:
        # A goal a few milliseconds after the last one would otherwise wait for a delayed TCP
        # acknowledgement (40 ms).
        # Both directions are asked for by whoever opens the topic here first. These handles stay
        # for that purpose.
        if self._fast_ends:
            return
        base, spec = rospy.remap_name(self.action_name), self._spec()
        for topic, message in (
            ('goal', spec.action_goal),
            ('result', spec.action_result),
            ('feedback', spec.action_feedback),
        ):
            if topic == 'goal':
                self._fast_ends.append(
                    rospy.Publisher(
                        base + '/' + topic, type(message), tcp_nodelay=True, queue_size=10
                    )
                )
            else:
                self._fast_ends.append(
                    rospy.Subscriber(base + '/' + topic, type(message), tcp_nodelay=True)
                )
        self._fast_ends.append(
            rospy.Subscriber(base + '/status', GoalStatusArray, tcp_nodelay=True)
        )

    def ready(self) -> bool:
        """Whether a server is connected on all topics, so that neither a goal nor its result can
        get lost.
        """
        connections = self._connections()
        if [id(each) for each in connections] != [id(each) for each in self._seen]:
            self._seen, self._seen_at = connections, time.monotonic()
        return bool(connections) and time.monotonic() - self._seen_at >= SETTLE_S

    def _connections(self) -> Tuple[Any, ...]:
        """The connections on which result and feedback come, or () while any topic is without the
        server.
        """
        client, watch = self.client, self.watch
        if client is None or watch is None or not watch.connections():
            return ()
        server_id = watch.server_id
        heard = tuple(
            _heard(topic, server_id) for topic in (client.result_sub, client.feedback_sub)
        )
        told = (client.pub_goal, client.pub_cancel)
        return (
            heard
            if all(heard) and all(topic.impl.has_connection(server_id) for topic in told)
            else ()
        )

    def problem(self, frozen_after_s: float) -> Optional[str]:
        """Return why the server must be regarded as lost, or None. See ServerWatch."""
        return self.watch.problem(frozen_after_s) if self.watch is not None else None

    def send_goal(
        self,
        goal: Any,
        on_transition: Callable[[Any], None],
        on_feedback: Callable[[Any, Any], None],
    ) -> Any:
        """Send ``goal`` (the action's Goal message), and return actionlib's goal handle, which
        keeps the goal tracked.
        """
        if self.client is None:
            raise smach.InvalidStateError(
                "Action '%s' is not connected: send_goal() before ready()" % self.action_name
            )
        with self._sending:
            return self.client.send_goal(goal, on_transition, on_feedback)


def _heard(subscriber: Any, server_id: str) -> Any:
    """The subscriber's connection to the server, or None."""
    return next(
        (
            connection
            for connection in subscriber.impl.connections or ()
            if getattr(connection, 'callerid_pub', None) == server_id
        ),
        None,
    )
