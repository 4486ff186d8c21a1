"""One connection to an action server, shared by all states of the process that use the action.

A link lives as long as the process: states come and go (and machines are executed hundreds of
times) without opening topics or threads again.
"""

import _thread
import threading
import time
import weakref
from typing import Any, Dict, List, Optional, Tuple

import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatusArray

import smach
from smach_common.action_topics import ActionTopics
from smach_common.connections import Connection
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

    def __init__(self, action_name: str, action_spec: Any) -> None:
        self.action_name = action_name
        self.topics: Optional[ActionTopics] = None
        self.watch: Optional[ServerWatch] = None
        self.active_runs: 'weakref.WeakSet[Any]' = weakref.WeakSet()
        self._spec = action_spec
        self._seen: List[Connection] = []
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
        topics = ActionTopics(self.action_name, self._spec)
        watch = ServerWatch(topics.client.status_sub)
        self._status_sub = rospy.Subscriber(
            topics.client.status_sub.name, GoalStatusArray, watch.note_status
        )
        self.watch = watch
        self.topics = topics

    def ready(self) -> bool:
        """Whether a server is connected on all topics, so that neither a goal nor its result can
        get lost.
        """
        topics, watch = self.topics, self.watch
        if topics is None or watch is None:
            return False
        connections = topics.connections_from(watch.server_id)
        if [id(each) for each in connections] != [id(each) for each in self._seen]:
            self._seen, self._seen_at = connections, time.monotonic()
        return bool(connections) and time.monotonic() - self._seen_at >= SETTLE_S

    def problem(self, frozen_after_s: float) -> Optional[str]:
        """Return why the server must be regarded as lost, or None. See ServerWatch."""
        return self.watch.problem(frozen_after_s) if self.watch is not None else None
