"""The five topics of an action, as its client sees them."""

import threading
from typing import Any, Callable, List, Type

import actionlib
import genpy
import rospy
from actionlib_msgs.msg import GoalStatusArray

from .connections import Connection, connection_from, reaches

OnTransition = Callable[[actionlib.ClientGoalHandle], None]
OnFeedback = Callable[[actionlib.ClientGoalHandle, genpy.Message], None]


class ActionTopics:
    """An action client that knows which servers are connected, and to which of its topics."""

    # actionlib counts the goals of all clients of a process without one: two could get the same id
    _sending = threading.Lock()

    def __init__(
        self,
        name: str,
        action_spec: Type[genpy.Message],
        make_client: Callable[..., actionlib.ActionClient] = actionlib.ActionClient,
    ) -> None:
        """Connections are made in the background.

        :param make_client: makes actionlib's client, of `name` and `action_spec`.
        """
        self.name = name
        self._undelayed = _open_undelayed(rospy.remap_name(name), action_spec())
        self.client = make_client(name, action_spec)

    def connections_from(self, server: str) -> List[Connection]:
        """Return the connections that bring a server's news of goals.

        The list is empty while any of the five topics lacks that server: a goal, or what becomes
        of it, could get lost.
        """
        client = self.client
        news = (client.status_sub, client.result_sub, client.feedback_sub)
        found = [connection_from(topic, server) for topic in news]
        heard = [each for each in found if each is not None]
        is_whole = len(heard) == len(news) and all(
            reaches(topic, server) for topic in (client.pub_goal, client.pub_cancel)
        )
        return heard if is_whole else []

    def send_goal(
        self, goal: genpy.Message, on_transition: OnTransition, on_feedback: OnFeedback
    ) -> actionlib.ClientGoalHandle:
        """Send a goal. actionlib follows it as long as somebody holds the handle."""
        with self._sending:
            return self.client.send_goal(goal, on_transition, on_feedback)

    def stop(self) -> None:
        """Take the topics down."""
        for handle in self._undelayed:
            handle.unregister()
        self.client.stop()


def _open_undelayed(name: str, action: genpy.Message) -> List[Any]:
    """Ask for messages that do not wait for a full packet, and return the handles that do so.

    Otherwise a goal a few milliseconds after the last one would wait for a delayed TCP
    acknowledgement (40 ms). The first handle on a topic decides, so these must be kept, too.
    """
    heard = (
        ('/status', GoalStatusArray),
        ('/result', type(action.action_result)),
        ('/feedback', type(action.action_feedback)),
    )
    return [
        rospy.Publisher(name + '/goal', type(action.action_goal), tcp_nodelay=True, queue_size=10),
        *(rospy.Subscriber(name + end, kind, tcp_nodelay=True) for end, kind in heard),
    ]
