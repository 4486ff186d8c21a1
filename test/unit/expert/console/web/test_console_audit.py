"""The audit of commands: the first who listens hears also what was said right before."""

import time

import rospy

from smach_oracle.expert.console.web import audit
from smach_oracle.expert.console.web.audit import Audit, AuditTopic, Person
from smach_oracle.msg import ConsoleCommand
from smach_oracle.ros.recording.recorder_topics import audit_topic


class FakePublisher:
    """A topic with as many listeners as a test wants; the last one of each name is kept."""

    made = {}

    def __init__(self, topic, *_, **__):
        FakePublisher.made[topic] = self
        self.sent = []
        self.publish = self.sent.append
        self.listeners = 0
        self.there = True

    def unregister(self):
        self.there = False

    def get_num_connections(self):
        return self.listeners


def make_topic(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    return AuditTopic('topic')


def test_a_recorder_that_comes_late_misses_nothing_and_hears_nothing_twice(monkeypatch):
    topic = make_topic(monkeypatch)
    topic.publish(ConsoleCommand(command='claim'))
    FakePublisher.made['topic'].listeners = 1
    heard = []
    topic.peer_subscribe('topic', None, heard.append)
    topic.publish(ConsoleCommand(command='answer'))
    topic.peer_subscribe('topic', None, heard.append)
    assert [each.command for each in heard] == ['claim']
    assert [each.command for each in FakePublisher.made['topic'].sent] == ['answer']


def test_what_was_said_long_before_is_not_news(monkeypatch):
    topic = make_topic(monkeypatch)
    topic.publish(ConsoleCommand(command='claim'))
    begun_s = time.monotonic()
    monkeypatch.setattr(time, 'monotonic', lambda: begun_s + audit.LONGEST_WAIT_S + 1.0)
    heard = []
    topic.peer_subscribe('topic', None, heard.append)
    assert heard == []
    for _ in range(2 * audit.MOST_WAITING):
        topic.publish(ConsoleCommand(command='drive'))
    topic.peer_subscribe('topic', None, heard.append)
    assert len(heard) == audit.MOST_WAITING, 'no more is kept'


def test_each_command_is_told_with_who_gave_it_and_never_at_length(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    monkeypatch.setattr(rospy, 'get_name', lambda: '/console')
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(audit, 'ros_now', rospy.Time)
    made = Audit()
    made.record(
        Person('10.0.0.7', 'abc', 'viewer', 'bob'), 'answer', False, 'x' * 9000, {'why': 'y' * 9000}
    )
    (record,) = FakePublisher.made['~audit'].sent
    assert (record.client, record.session, record.role, record.expert, record.ok) == (
        '10.0.0.7',
        'abc',
        'viewer',
        'bob',
        False,
    )
    assert len(record.message) == 1000 and len(record.arguments) == audit.LONGEST_ARGUMENTS


def test_beside_servers_that_are_gone_nothing_is_advertised_any_more(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    made = Audit()
    made.prepare(['/a/expert_query', '/b/expert_query'])
    first, second = (
        FakePublisher.made[audit_topic(name)] for name in ('/a/expert_query', '/b/expert_query')
    )
    made.prepare(['/b/expert_query'])
    assert FakePublisher.made[audit_topic('/b/expert_query')] is second
    assert second.there and not first.there


def test_what_is_told_of_a_server_that_is_gone_reaches_nobody(monkeypatch):
    topic = make_topic(monkeypatch)
    topic.stop()
    FakePublisher.made['topic'].listeners = 1
    topic.publish(ConsoleCommand(command='answer'))
    heard = []
    topic.peer_subscribe('topic', None, heard.append)
    assert FakePublisher.made['topic'].sent == [] and heard == []
