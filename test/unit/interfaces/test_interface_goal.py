"""What a person may end the goal of an interface with; no master."""

import threading

import pytest

from smach_oracle.interfaces import interface_goal as module
from smach_oracle.interfaces.interface_goal import InterfaceGoal, InterfaceGoalError
from smach_oracle.msg import SharedAutonomyGoal
from smach_oracle.ros.userdata_codec import decode_all, encode


class FakeActionServer:
    """An action server without ROS; the last one is kept."""

    made = None

    def __init__(self, _name, _kind, on_goal, _on_cancel, auto_start):
        FakeActionServer.made = self
        self.lock = threading.RLock()
        self.send_goal = on_goal

    def start(self):
        """Nothing to be done."""


class FakeHandle:
    """A goal of a state GRASP, and what became of it."""

    def __init__(self):
        self.accepted = False
        self.result = None

    def get_goal(self):
        return SharedAutonomyGoal(state='GRASP', outcomes=['grasped'], output_keys=['object'])

    def set_accepted(self):
        self.accepted = True

    def set_succeeded(self, result, _text):
        self.result = result


@pytest.fixture(name='active')
def make_active(monkeypatch):
    """An interface with an active goal, and the handle of that goal."""
    monkeypatch.setattr(module, 'QuietActionServer', FakeActionServer)
    monkeypatch.setattr(module.rospy, 'resolve_name', lambda name: name)
    goal, handle = InterfaceGoal('hand', lambda goal: None, lambda: None), FakeHandle()
    FakeActionServer.made.send_goal(handle)
    assert handle.accepted
    return goal, handle


def test_an_output_that_is_given_overrides_what_the_interface_knows(active):
    goal, handle = active
    goal.finish('grasped', {'object': 'cup', 'arm': 'left'}, [encode('object', 'mug')])
    assert decode_all(handle.result.outputs) == {'object': 'mug'}
    assert goal.goal is None


@pytest.mark.parametrize(
    'outcome, given, why',
    [
        ('dropped', [], "no outcome 'dropped'"),
        ('grasped', [encode('arm', 'left')], 'no output keys arm'),
        ('grasped', [encode('object', 'cup'), encode('object', 'mug')], 'come twice: object'),
    ],
)
def test_what_does_not_fit_is_refused_and_the_goal_stays_open(active, outcome, given, why):
    goal, handle = active
    with pytest.raises(InterfaceGoalError, match=why):
        goal.finish(outcome, {}, given)
    assert handle.result is None
    assert goal.goal.state == 'GRASP'
