"""When a link to an action server counts as ready; no master."""

import time

import pytest
from waiting import stays, wait_for

pytest.importorskip('rospy')
pytest.importorskip('smach_ros')
from actionlib.msg import TestAction

from smach_common import action_topics
from smach_ros import action_link
from smach_ros.action_link import ActionLink


class FakeTopic:
    """A topic of the client's with connections to the servers named."""

    def __init__(self, *servers):
        self.impl = self
        self.connections = [FakeConnection(server) for server in servers]

    def check(self):
        pass

    def has_connection(self, server):
        return any(connection.callerid_pub == server for connection in self.connections)


class FakeConnection:
    def __init__(self, server):
        self.callerid_pub = server
        self.socket = object()


class FakeClient:
    def __init__(self):
        self.pub_goal, self.pub_cancel = FakeTopic('/server'), FakeTopic('/server')
        self.result_sub, self.feedback_sub = FakeTopic('/server'), FakeTopic('/server')
        self.status_sub = FakeTopic('/server')


class FakeWatch:
    server_id = '/server'


@pytest.fixture
def link(monkeypatch):
    monkeypatch.setattr(ActionLink, '_connect', lambda self: None)
    monkeypatch.setattr(action_link, 'SETTLE_S', 0.2)
    monkeypatch.setattr(action_topics, '_open_undelayed', lambda name, action: [])
    link = ActionLink('work', TestAction)
    client = FakeClient()
    link.topics = action_topics.ActionTopics('work', TestAction, lambda name, spec: client)
    link.watch = FakeWatch()
    return link


def becomes_ready_s(link):
    begin = time.monotonic()
    wait_for(link.ready, 5.0)
    return time.monotonic() - begin


def test_a_new_connection_is_given_time_to_be_known_to_the_server(link):
    assert 0.2 <= becomes_ready_s(link) < 5.0
    assert becomes_ready_s(link) < 0.2


def test_a_connection_made_anew_is_given_that_time_again(link):
    becomes_ready_s(link)
    link.topics.client.result_sub = FakeTopic('/server')
    assert 0.2 <= becomes_ready_s(link) < 5.0


TOPICS = ['pub_goal', 'pub_cancel', 'status_sub', 'result_sub', 'feedback_sub']


@pytest.mark.parametrize('topic', TOPICS)
def test_a_topic_without_the_server_is_waited_for(link, topic):
    setattr(link.topics.client, topic, FakeTopic('/another'))
    assert stays(lambda: not link.ready(), 0.3), 'longer than a new connection is given'
