"""While a script is checked, what would wait for others, or move them, does nothing.

Waits return at once, as if all were there. Services and actions answer with an empty message. Each
is told once.
"""

from typing import Any, Callable, Dict, Optional, Tuple

import actionlib
import rospy
import rospy.client
import rospy.impl.tcpros_service
from actionlib_msgs.msg import GoalStatus

Note = Callable[[str], None]


def install(note: Note, spin: Callable[[], None]) -> None:
    """Replace the waits of rospy and actionlib in this process, for good.

    :param note: is told what people should know.
    :param spin: what `rospy.spin` does.
    """
    for module in (rospy, rospy.client):
        module.spin = spin
        module.wait_for_message = _wait_for_message(note)
    for place in (rospy, rospy.impl.tcpros_service):
        place.wait_for_service = _wait_for_service(note)
    _stub_services(note)
    _stub_actions(note)


def _wait_for_service(note: Note) -> Callable[..., None]:
    def wait_for_service(service: str, timeout: Optional[float] = None) -> None:
        note('waits for service {}: taken as there'.format(service))

    return wait_for_service


def _wait_for_message(note: Note) -> Callable[..., Any]:
    def wait_for_message(topic: str, topic_type: Any, timeout: Optional[float] = None) -> Any:
        note('waits for a message on {}: gets an empty one'.format(topic))
        return topic_type()

    return wait_for_message


def _stub_services(note: Note) -> None:
    def call(self: Any, *args: Any, **kwargs: Any) -> Any:
        note('calls service {}: gets an empty response'.format(self.resolved_name))
        return self.response_class()

    def wait_for_service(self: Any, timeout: Optional[float] = None) -> None:
        note('waits for service {}: taken as there'.format(self.resolved_name))

    for name, function in (
        ('__call__', call),
        ('call', call),
        ('wait_for_service', wait_for_service),
    ):
        setattr(rospy.ServiceProxy, name, function)


def _stub_actions(note: Note) -> None:
    """Goals of either client go nowhere, and count as reached."""
    for name, function in _simple_client(note).items():
        setattr(actionlib.SimpleActionClient, name, function)

    def wait_for_server(self: Any, timeout: Any = None) -> bool:
        note('waits for action server {}: taken as there'.format(self.ns))
        return True

    def send_goal(self: Any, goal: Any, *callbacks: Any, **named: Any) -> None:
        note('sends a goal to {}: it goes nowhere'.format(self.ns))

    setattr(actionlib.ActionClient, 'wait_for_server', wait_for_server)
    setattr(actionlib.ActionClient, 'send_goal', send_goal)


def _simple_client(note: Note) -> Dict[str, Callable[..., Any]]:
    def result_of(client: Any) -> Tuple[int, Any]:
        return GoalStatus.SUCCEEDED, client.action_client.ActionSpec().action_result.result

    def wait(self: Any, timeout: Any = None) -> bool:
        note('waits for action server {}: taken as there'.format(self.action_client.ns))
        return True

    def send_goal(
        self: Any,
        goal: Any,
        done_cb: Optional[Callable[..., None]] = None,
        active_cb: Any = None,
        feedback_cb: Any = None,
    ) -> None:
        note('sends a goal to {}: taken as reached'.format(self.action_client.ns))
        if done_cb is not None:
            done_cb(*result_of(self))

    def send_goal_and_wait(self: Any, goal: Any, *timeouts: Any, **named: Any) -> int:
        send_goal(self, goal)
        return result_of(self)[0]

    return {
        'wait_for_server': wait,
        'send_goal': send_goal,
        'send_goal_and_wait': send_goal_and_wait,
        'wait_for_result': lambda self, *timeout, **named: True,
        'get_result': lambda self: result_of(self)[1],
        'get_state': lambda self: result_of(self)[0],
        'get_goal_status_text': lambda self: '',
        'cancel_goal': lambda self: None,
        'cancel_all_goals': lambda self: None,
        'cancel_goals_at_and_before_time': lambda self, time: None,
        'stop_tracking_goal': lambda self: None,
    }
