"""The status of what operators hold, published by a thread of its own."""

import pytest
import rospy
from waiting import stays, wait_for

import smach
from smach_oracle.oracle import OperatorHand, OracleContainer
from smach_oracle.ros.hand import status_publisher
from smach_oracle.ros.hand.status_publisher import ControlPublisher, to_msg


class FakeTopic:
    """Keeps what is published; as many listen as a test says."""

    def __init__(self):
        self.messages = []
        self.listeners = 0

    def publish(self, message):
        self.messages.append(message)

    def get_num_connections(self):
        return self.listeners


@pytest.fixture
def topic(monkeypatch):
    made = FakeTopic()
    over = []
    monkeypatch.setattr(rospy, 'Publisher', lambda *args, **kwargs: made)
    monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time(1))
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: bool(over))
    monkeypatch.setattr(status_publisher, '_MOVES_PERIOD_S', 0.01)
    yield made
    over.append(True)


def hand():
    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        smach.StateMachine.add('A', smach.State(outcomes=['done']))
    return OperatorHand(OracleContainer.wrap(machine, name='task'))


def test_a_change_is_published_and_a_transition_only_where_anybody_listens(topic):
    shown = hand()
    publisher = ControlPublisher(lambda: [('task', shown)])
    publisher.start()
    publisher.changed()
    assert wait_for(lambda: len(topic.messages) == 1)
    assert topic.messages[0].machines[0].path == 'task'
    publisher.moved()
    assert stays(lambda: len(topic.messages) == 1, 0.1)
    topic.listeners = 1
    assert wait_for(lambda: len(topic.messages) == 2)


def test_all_that_is_set_is_in_the_message():
    held = hand()
    held.pause('eva')
    held.set_breakpoint('A')
    held.set_autonomy('A', 'confirm')
    message = to_msg(held.status())
    assert (message.path, message.running, message.paused, message.paused_by) == (
        'task',
        False,
        True,
        'eva',
    )
    assert (message.breakpoints, message.autonomy_patterns, message.autonomy_levels) == (
        ['A'],
        ['A'],
        ['confirm'],
    )
