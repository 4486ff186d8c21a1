"""The status of an action server goes on where simulated time is set back."""
from types import SimpleNamespace

import pytest

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
