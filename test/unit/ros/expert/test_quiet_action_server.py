"""The status of an action server goes on where simulated time is set back."""

from types import SimpleNamespace

import pytest
from actionlib_msgs.msg import GoalID

from smach_oracle.msg import ExpertQueryAction
from smach_oracle.ros.expert import quiet_action_server
from smach_oracle.ros.expert.quiet_action_server import QuietActionServer


class FakeTimer:
    """A timer that keeps what it was made with."""

    def __init__(self, period, callback, reset=False):
        self.made_with = (period.to_sec(), callback, reset)
        self.is_shut_down = False

    def shutdown(self):
        self.is_shut_down = True


@pytest.mark.parametrize('has_timer', [True, False])
def test_the_timer_of_the_status_goes_on_where_time_is_set_back(has_timer, monkeypatch):
    first = FakeTimer(SimpleNamespace(to_sec=lambda: 0.2), None) if has_timer else None

    def initialize(server):
        server.status_timer, server.status_frequency = first, 5.0 if has_timer else 0.0

    monkeypatch.setattr(quiet_action_server.actionlib.ActionServer, 'initialize', initialize)
    monkeypatch.setattr(quiet_action_server.rospy, 'Timer', FakeTimer)
    server = QuietActionServer('/ask', ExpertQueryAction, print, auto_start=False)
    server.initialize()
    if first is None:
        assert server.status_timer is None
    else:
        assert first.is_shut_down
        assert server.status_timer.made_with == (0.2, server.publish_status_async, True)


def test_a_bag_that_is_played_is_named_once(monkeypatch):
    warnings = []
    monkeypatch.setattr(quiet_action_server, 'LISTENS_AFTER_S', 0.0)
    monkeypatch.setattr(quiet_action_server, 'listens', lambda publisher, node: False)
    monkeypatch.setattr(quiet_action_server, 'sender_of', lambda message: '/player')
    monkeypatch.setattr(
        quiet_action_server.rospy, 'logwarn', lambda *args: warnings.append(args[0] % args[1:])
    )
    server = QuietActionServer('/ask', ExpertQueryAction, pytest.fail, auto_start=False)
    server.result_pub = None
    for _ in range(3):
        server.internal_goal_callback(ExpertQueryAction().action_goal)
        server.internal_cancel_callback(GoalID())
    assert sorted('goal' in text for text in warnings) == [False, True]
