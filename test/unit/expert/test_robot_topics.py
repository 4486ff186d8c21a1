"""Robots come and go: the latest are listened to, whoever else was."""

import pytest

from smach_oracle.expert import robot_topics
from smach_oracle.expert.interface_outputs import InterfaceOutputs
from smach_oracle.expert.robot_topics import RobotTopics
from smach_oracle.msg import InterfaceOutput


@pytest.fixture(name='heard')
def listened_to(monkeypatch):
    """Topics that are listened to now."""
    topics = []

    class FakeTopic:
        def __init__(self, robot, topic, *_):
            self._topic = robot + topic
            topics.append(self._topic)

        def stop(self):
            topics.remove(self._topic)

    monkeypatch.setattr(robot_topics, 'RobotTopic', FakeTopic)
    monkeypatch.setattr(robot_topics, 'MOST_ROBOTS', 3)
    return topics


def follower():
    return RobotTopics('/output', InterfaceOutput, lambda robot: robot, queue_size=1)


def test_a_robot_that_comes_late_is_heard_and_who_has_asked_nothing_for_longest_goes(heard):
    topics = follower()
    for asking in (['/a'], ['/b', '/c'], ['/a', '/d'], []):
        topics.follow(asking)
    assert sorted(heard) == ['/a/output', '/c/output', '/d/output']


def test_of_too_many_at_a_time_none_is_dropped_for_another(heard):
    topics = follower()
    for _ in range(3):
        topics.follow(['/{}'.format(name) for name in 'abcde'])
    assert heard == ['/a/output', '/b/output', '/c/output']


def test_what_is_no_name_of_a_node_is_not_listened_to(heard):
    follower().follow(['', '/a b', '<b>', '/a', '/a'])
    assert heard == ['/a/output']


def test_a_follower_that_stops_listens_to_no_robot(heard):
    topics = follower()
    topics.follow(['/a', '/b'])
    topics.stop()
    assert heard == []


def test_what_robots_print_is_kept_of_the_latest_only():
    outputs = InterfaceOutputs()
    for number in range(100):
        outputs.taker('/robot_{}'.format(number))(
            InterfaceOutput(query_id='q{}'.format(number), lines=['hello'])
        )
    assert outputs.newest('q99').lines == ['hello'] and outputs.newest('q0') is None


def test_the_output_for_one_question_stays_while_the_robot_prints_for_another():
    outputs = InterfaceOutputs('q1')
    take = outputs.taker('/robot')
    take(InterfaceOutput(query_id='q1', lines=['hello']))
    take(InterfaceOutput(query_id='q2', lines=['other']))
    assert outputs.newest('q1').lines == ['hello'] and outputs.newest('q2') is None


def test_a_robot_s_outputs_for_two_questions_stay_side_by_side():
    outputs = InterfaceOutputs()
    take = outputs.taker('/robot')
    take(InterfaceOutput(query_id='q1', lines=['hello']))
    take(InterfaceOutput(query_id='q2', lines=['other']))
    assert outputs.newest('q1').lines == ['hello'] and outputs.newest('q2').lines == ['other']
