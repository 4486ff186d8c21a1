"""The audit of commands: the first who listens hears also what was said right before."""
import time

import rospy

from smach_oracle.expert.console import audit
from smach_oracle.expert.console.audit import Audit, Person, Told
from smach_oracle.msg import ConsoleCommand


class FakePublisher:

    def __init__(self, *_, **__):
        self.sent = []
        self.publish = self.sent.append
        self.listeners = 0
        self.there = True

    def unregister(self):
        self.there = False

    def get_num_connections(self):
        return self.listeners


def told(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    return Told('topic')


def test_a_recorder_that_comes_late_misses_nothing_and_hears_nothing_twice(monkeypatch):
    topic = told(monkeypatch)
    topic.tell(ConsoleCommand(command='claim'))
    topic._publisher.listeners = 1
    heard = []
    topic.peer_subscribe('topic', None, heard.append)
    topic.tell(ConsoleCommand(command='answer'))
    topic.peer_subscribe('topic', None, heard.append)
    assert [each.command for each in heard] == ['claim']
    assert [each.command for each in topic._publisher.sent] == ['answer']


def test_what_was_said_long_before_is_not_news(monkeypatch):
    topic = told(monkeypatch)
    topic.tell(ConsoleCommand(command='claim'))
    begun_s = time.monotonic()
    monkeypatch.setattr(time, 'monotonic', lambda: begun_s + audit.LONGEST_WAIT_S + 1.0)
    heard = []
    topic.peer_subscribe('topic', None, heard.append)
    for _ in range(2 * audit.MOST_WAITING):
        topic.tell(ConsoleCommand(command='drive'))
    assert heard == [] and len(topic._waiting) == audit.MOST_WAITING


def test_each_command_is_told_with_who_gave_it_and_never_at_length(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    monkeypatch.setattr(rospy, 'get_name', lambda: '/console')
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(audit, 'ros_now', rospy.Time)
    book = Audit()
    book.tell(Person('10.0.0.7', 'abc', 'viewer', 'bob'), 'answer', False, 'x' * 9000, {'why': 'y' * 9000})
    record, = book._own.sent
    assert (record.client, record.session, record.role, record.expert, record.ok) == (
        '10.0.0.7', 'abc', 'viewer', 'bob', False)
    assert len(record.message) == 1000 and len(record.arguments) == audit.LONGEST_ARGUMENTS


def test_beside_servers_that_are_gone_nothing_is_advertised_any_more(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    book = Audit()
    book.prepare(['/a/expert_query', '/b/expert_query'])
    first, second = (book._by_server[name] for name in ('/a/expert_query', '/b/expert_query'))
    book.prepare(['/b/expert_query'])
    assert list(book._by_server) == ['/b/expert_query'] and book._by_server['/b/expert_query'] is second
    assert second._publisher.there and not first._publisher.there
    first.tell(ConsoleCommand(command='answer'))
    assert first._publisher.sent == [] and not first._waiting
