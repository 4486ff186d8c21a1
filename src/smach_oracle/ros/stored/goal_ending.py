"""Ends the goals of a program that was killed: cancels them, and waits until they have ended."""

import threading
import time
from typing import Callable, Dict, List, Mapping

import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from smach_common.connections import live_connections

POLL_S = 0.05
CANCEL_EACH_S = 1.0
# a server that nobody has connected to by then is taken as gone
SERVER_WAIT_S = 5.0
TELL_EACH_S = 10.0
_RUNS = frozenset(
    (GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.RECALLING)
)


def end_goals(servers: Mapping[str, str], must_stop: Callable[[], bool]) -> Dict[str, str]:
    """Cancel goals and wait until their servers say that they do not run.

    `servers`: by goal id. A server that is there is waited for without end, as the robot may still
    move. One that is not there within `SERVER_WAIT_S` is not.

    :returns: those of which the end is not known.
    """
    by_server: Dict[str, List[str]] = {}
    for goal_id, server in servers.items():
        by_server.setdefault(server, []).append(goal_id)
    ending = [_Server(server, ids) for server, ids in by_server.items()]
    begun_s = told_s = time.monotonic()
    try:
        while any([each.is_waited_for(time.monotonic() - begun_s) for each in ending]):
            if must_stop() or rospy.is_shutdown():
                break
            if time.monotonic() - told_s > TELL_EACH_S:
                told_s = time.monotonic()
                rospy.logwarn(
                    'Waits for goals of the killed program to end: %s',
                    ', '.join(each.name for each in ending if each.left),
                )
            time.sleep(POLL_S)
    finally:
        for each in ending:
            each.close()
    return {goal_id: each.name for each in ending for goal_id in each.left}


class _Server:
    """The goals that one action server is to end."""

    def __init__(self, name: str, goals: List[str]) -> None:
        self.name, self.left = name, set(goals)
        self._lock = threading.Lock()
        self._cancelled_s: Dict[str, float] = {}
        self._cancel = rospy.Publisher(name + '/cancel', GoalID, queue_size=10)
        self._status = rospy.Subscriber(
            name + '/status', GoalStatusArray, self._on_status, queue_size=1
        )

    def is_waited_for(self, waited_s: float) -> bool:
        """Whether goals are left, and a server that can end them."""
        return bool(self.left) and (
            waited_s < SERVER_WAIT_S or bool(live_connections(self._status))
        )

    def close(self) -> None:
        self._status.unregister()
        self._cancel.unregister()

    def _on_status(self, message: GoalStatusArray) -> None:
        """Take what runs. What the server does not know has ended."""
        running = {each.goal_id.id for each in message.status_list if each.status in _RUNS}
        with self._lock:
            self.left.intersection_update(running)
            for goal_id in self.left:
                self._cancel_now_and_then(goal_id)

    def _cancel_now_and_then(self, goal_id: str) -> None:
        if not self._cancel.get_num_connections():
            return
        now_s = time.monotonic()
        if now_s - self._cancelled_s.get(goal_id, -CANCEL_EACH_S) >= CANCEL_EACH_S:
            self._cancelled_s[goal_id] = now_s
            self._cancel.publish(GoalID(id=goal_id))
