"""Sends goals to an action server, and notices at once when the server is gone.

actionlib's own waiting goes by ROS time, which stands still in a paused simulation, and does not
notice a server that has died. This goes by the connections themselves.
"""

import math
import queue
import threading
import time
from typing import Dict, List, NamedTuple, Optional, Type

import actionlib
import genpy
import rospy
from actionlib_msgs.msg import GoalStatus

from .connections import Connection, ConnectionGrace, live_connections
from .introspection.viewer_jump import sender_of
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


class SentGoal:
    """One goal on its way. `poll` waits for its next event."""

    def __init__(self, sent_s: float) -> None:
        # not a SimpleQueue: its timed get waits forever where a signal handler takes longer than
        # the timeout
        self._events: 'queue.Queue[GoalEvent]' = queue.Queue()
        self._sent_s = sent_s
        self._acknowledged = False
        self._ended_s: Optional[float] = None
        self._handle: Optional[actionlib.ClientGoalHandle] = None

    def attach(self, handle: actionlib.ClientGoalHandle) -> None:
        """Keep the handle: actionlib follows a goal only as long as somebody holds its handle."""
        self._handle = handle

    def poll(self, timeout_s: float = POLL_S) -> Optional[GoalEvent]:
        """Return the next event, or None where there is none within the time."""
        try:
            return self._events.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def unheard(self, now_s: float) -> bool:
        """Whether the server's acknowledgement or result is overdue."""
        if self._ended_s is not None:
            return now_s - self._ended_s > _RESULT_S
        return not self._acknowledged and now_s - self._sent_s > _ACK_S

    def cancel(self) -> None:
        """Take it back, and return at once."""
        if self._handle is not None:
            try:
                self._handle.cancel()
            except rospy.ROSException:
                # the topic is closed: the node is going down, and the server will notice
                rospy.logdebug('A goal could not be cancelled while the node goes down.')

    def on_transition(self, handle: actionlib.ClientGoalHandle) -> None:
        """Take a transition. This is actionlib's callback."""
        state = handle.get_comm_state()
        self._acknowledged = self._acknowledged or state != actionlib.CommState.WAITING_FOR_GOAL_ACK
        if state == actionlib.CommState.WAITING_FOR_RESULT:
            self._ended_s = time.monotonic()
        elif state == actionlib.CommState.DONE:
            self._events.put(
                GoalEvent(
                    status=handle.get_terminal_state(),
                    result=handle.get_result(),
                    text=handle.get_goal_status_text(),
                )
            )

    def on_feedback(self, _handle: actionlib.ClientGoalHandle, feedback: genpy.Message) -> None:
        """Take feedback. This is actionlib's callback."""
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


class GoalLink:
    """An action client that knows whether its server is there."""

    _sending = threading.Lock()  # actionlib's goal ids are not made safely from several threads

    def __init__(self, name: str, action_spec: Type[genpy.Message]) -> None:
        """`name` is resolved. Connections are made in the background."""
        self.name = name
        # Small messages that must not wait for a full packet, the first subscriber of a topic
        # decides.
        self._fast = [
            rospy.Subscriber(name + end, kind, queue_size=10, tcp_nodelay=True)
            for end, kind in (
                ('/result', type(action_spec().action_result)),
                ('/feedback', type(action_spec().action_feedback)),
            )
        ]
        self._client = ServedClient(name, action_spec)
        self._grace = ConnectionGrace()

    def ready(self) -> bool:
        """Whether one live server is connected to all five topics of the action.

        Takes a moment where it has just been connected: the result of a goal that ends at once
        would get lost.
        """
        heard = self._heard()
        if heard:
            self._grace.wait(heard)
        return bool(heard)

    def _heard(self) -> List[Connection]:
        """The connections that bring news of goals, or [] while any topic lacks one."""
        client = self._client
        news = (client.status_sub, client.result_sub, client.feedback_sub)
        for server in [each.callerid_pub for each in live_connections(client.status_sub)]:
            heard = [
                next(
                    (each for each in live_connections(topic) if each.callerid_pub == server), None
                )
                for topic in news
            ]
            if (
                all(heard)
                and _reaches(client.pub_goal, server)
                and _reaches(client.pub_cancel, server)
            ):
                return heard
        return []

    def alive(self) -> bool:
        """Whether any server is connected. It is false within milliseconds of its death."""
        return bool(live_connections(self._client.status_sub))

    def send(self, goal: genpy.Message, now_s: float) -> SentGoal:
        """Send a goal. The caller has seen `ready`."""
        sent = SentGoal(now_s)
        with self._sending:
            sent.attach(self._client.send_goal(goal, sent.on_transition, sent.on_feedback))
        return sent

    def stop(self) -> None:
        """Take the five topics down."""
        if rospy.is_shutdown():
            return  # they are down
        for subscriber in self._fast:
            subscriber.unregister()
        self._client.stop()


def lost(event: GoalEvent) -> bool:
    """Whether the goal ended because the server no longer knows it (it was restarted)."""
    return event.status == GoalStatus.LOST


def _reaches(publisher: rospy.Publisher, subscriber: str) -> bool:
    """Whether a living node of that name listens.

    rospy looks only now and then whether one has died. One that was started again under its name
    would seem to be there before it listens.
    """
    topic = publisher.impl
    if topic is None:
        return False
    topic.check()
    return bool(topic.has_connection(subscriber))
