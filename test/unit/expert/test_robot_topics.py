"""Robots come and go: the latest are listened to, whoever else was."""
import pytest
import rospy

from smach_oracle.expert.console import robot_topics
from smach_oracle.expert.console.interface_outputs import InterfaceOutputs
from smach_oracle.expert.console.robot_topics import RobotTopics
from smach_oracle.msg import InterfaceOutput


@pytest.fixture(name='heard')
def listened_to(monkeypatch):
    """Topics that are subscribed to now."""
    topics = []

    class FakeSubscriber:

        def __init__(self, topic, *_, **__):
            self._topic = topic
            topics.append(topic)

        def unregister(self):
            topics.remove(self._topic)

    monkeypatch.setattr(rospy, 'Subscriber', FakeSubscriber)
    monkeypatch.setattr(robot_topics, 'MOST_ROBOTS', 3)
    return topics


def test_a_robot_that_comes_late_is_heard_and_who_has_asked_nothing_for_longest_goes(heard):
    topics = RobotTopics('/output', InterfaceOutput, lambda robot: robot)
    for asking in (['/a'], ['/b', '/c'], ['/a', '/d'], []):
        topics.follow(asking)
    assert sorted(heard) == ['/a/output', '/c/output', '/d/output']


def test_of_too_many_at_a_time_none_is_dropped_for_another(heard):
    topics = RobotTopics('/output', InterfaceOutput, lambda robot: robot)
    for _ in range(3):
        topics.follow(['/{}'.format(name) for name in 'abcde'])
    assert heard == ['/a/output', '/b/output', '/c/output']


def test_what_is_no_name_of_a_node_is_not_listened_to(heard):
    RobotTopics('/output', InterfaceOutput, lambda robot: robot).follow(['', '/a b', '<b>', '/a', '/a'])
    assert heard == ['/a/output']


def test_what_robots_print_is_kept_of_the_latest_only(heard):
    outputs = InterfaceOutputs()
    for number in range(100):
        outputs.taker('/robot_{}'.format(number))(InterfaceOutput(query_id='q{}'.format(number), lines=['hello']))
    assert outputs.view('q99')['lines'] == ['hello'] and outputs.view('q0') is None
