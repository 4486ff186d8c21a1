"""Sends goals to an action server, and notices at once when the server is gone.

actionlib's own waiting goes by ROS time, which stands still in a paused simulation, and does not
notice a server that has died. This goes by the connections themselves.
"""

import math
import queue
import time
from typing import Dict, NamedTuple, Optional, Type

import actionlib
import genpy
import rospy
from actionlib_msgs.msg import GoalStatus

from smach_common.action_topics import ActionTopics
from smach_common.connections import live_connections, sender_of
from smach_common.tracked_goal import TrackedGoal

from .connections import ConnectionGrace
from .senders.own_messages import LISTENS_AFTER_S, listens

# how often a waiting thread looks at things that cannot wake it: a cancel flag, a connection
POLL_S = 0.02
_ACK_S = 3.0  # a goal that nobody acknowledged by then was lost on its way
_RESULT_S = 2.0  # so was the result of a goal that has ended so long ago


class GoalEvent(NamedTuple):
    """Feedback (`feedback` set), or the end of the goal (`status` set, `result` may be None)."""

    feedback: Optional[genpy.Message] = None
    status: int = 0
    result: Optional[genpy.Message] = None
    text: str = ''  # the server's reason for the end


class SentGoal(TrackedGoal):
    """One goal on its way. `poll` waits for its next event."""

    def __init__(self) -> None:
        super().__init__(_ACK_S, _RESULT_S)
        # not a SimpleQueue: its timed get waits forever where a signal handler takes longer than
        # the timeout
        self._events: 'queue.Queue[GoalEvent]' = queue.Queue()

    def poll(self, timeout_s: float = POLL_S) -> Optional[GoalEvent]:
        """Return the next event, or None where there is none within the time."""
        try:
            return self._events.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def unheard(self, now_s: float) -> bool:
        """Whether the server's acknowledgement or result is overdue."""
        return self.lacks_acknowledgement(now_s) or self.lacks_result(now_s)

    def cancel(self) -> None:
        """Take it back, and return at once."""
        if self.handle is not None:
            try:
                self.handle.cancel()
            except rospy.ROSException:
                # the topic is closed: the node is going down, and the server will notice
                rospy.logdebug('A goal could not be cancelled while the node goes down.')

    def take_state(self, state: int, handle: actionlib.ClientGoalHandle) -> None:
        """Queue the end of the goal."""
        if state == actionlib.CommState.DONE:
            self._events.put(
                GoalEvent(
                    status=handle.get_terminal_state(),
                    result=handle.get_result(),
                    text=handle.get_goal_status_text(),
                )
            )

    def on_feedback(self, _handle: actionlib.ClientGoalHandle, feedback: genpy.Message) -> None:
        """Queue feedback. This is actionlib's callback."""
        self._events.put(GoalEvent(feedback=feedback))


class ServedClient(actionlib.ActionClient):
    """actionlib's. It believes only a node that listens for goals, and no bag that is played.

    The statuses of a bag do not have the goal, so it would take it for lost.
    """

    def __init__(self, ns: str, action_spec: Type[genpy.Message]) -> None:
        self._ignored_s: Dict[str, float] = {}  # since when, by node; inf: it was named
        super().__init__(ns, action_spec)

    def _status_cb(self, msg: genpy.Message) -> None:
        if self._is_of_server(msg):
            super()._status_cb(msg)

    def _result_cb(self, msg: genpy.Message) -> None:
        if self._is_of_server(msg):
            super()._result_cb(msg)

    def _feedback_cb(self, msg: genpy.Message) -> None:
        if self._is_of_server(msg):
            super()._feedback_cb(msg)

    def _is_of_server(self, msg: genpy.Message) -> bool:
        node, now_s = sender_of(msg), time.monotonic()
        if listens(self.pub_goal, node):
            self._ignored_s.pop(node, None)
            return True
        if now_s - self._ignored_s.setdefault(node, now_s) > LISTENS_AFTER_S:
            self._ignored_s[node] = math.inf
            rospy.logwarn(
                '%s: ignored what %s reports about goals, as it does not listen for '
                'them. A bag that is played does that',
                rospy.resolve_name(self.ns),
                node,
            )
        return False


class GoalLink(ActionTopics):
    """An action client that knows whether its server is there."""

    def __init__(self, name: str, action_spec: Type[genpy.Message]) -> None:
        """`name` is resolved. Connections are made in the background."""
        super().__init__(name, action_spec, ServedClient)
        self._grace = ConnectionGrace()

    def ready(self) -> bool:
        """Whether one live server is connected to all five topics of the action.

        Takes a moment where it has just been connected: the result of a goal that ends at once
        would get lost.
        """
        for each in live_connections(self.client.status_sub):
            heard = self.connections_from(each.callerid_pub)
            if heard:
                self._grace.wait(heard)
                return True
        return False

    def alive(self) -> bool:
        """Whether any server is connected. It is false within milliseconds of its death."""
        return bool(live_connections(self.client.status_sub))

    def send(self, goal: genpy.Message) -> SentGoal:
        """Send a goal. The caller has seen `ready`."""
        sent = SentGoal()
        sent.send_on(self, goal)
        return sent

    def stop(self) -> None:
        """Take the five topics down."""
        if not rospy.is_shutdown():  # else they are down
            super().stop()


def lost(event: GoalEvent) -> bool:
    """Whether the goal ended because the server no longer knows it (it was restarted)."""
    return event.status == GoalStatus.LOST
