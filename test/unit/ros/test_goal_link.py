"""What of a goal on its way counts as lost; no master."""

import time
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from actionlib import CommState

from smach_common.connections import reaches
from smach_oracle.msg import SharedAutonomyAction
from smach_oracle.ros import connections, goal_link
from smach_oracle.ros.goal_link import GoalLink, SentGoal, ServedClient


class FakeHandle:
    def __init__(self, state):
        self._state = state

    def get_comm_state(self):
        return self._state

    def get_terminal_state(self):
        return 3

    def get_result(self):
        return 'the result'

    def get_goal_status_text(self):
        return 'as told'


def sent_and_seen(*states):
    sent = SentGoal()
    for state in states:
        sent.on_transition(FakeHandle(state))
    return sent


@pytest.mark.parametrize(
    'states, lost',
    [
        ([], True),
        ([CommState.PENDING], False),
        ([CommState.WAITING_FOR_CANCEL_ACK], True),
        ([CommState.PENDING, CommState.ACTIVE], False),
        ([CommState.ACTIVE, CommState.WAITING_FOR_RESULT], True),
    ],
)
def test_a_goal_nobody_took_up_and_an_end_without_a_result_are_lost_in_time(states, lost):
    sent = sent_and_seen(*states)
    assert not sent.unheard(time.monotonic() + 1.0)
    assert sent.unheard(time.monotonic() + 60.0) == lost


def test_a_result_that_is_here_is_an_event():
    event = sent_and_seen(CommState.ACTIVE, CommState.WAITING_FOR_RESULT, CommState.DONE).poll(0.0)
    assert (event.status, event.result, event.text) == (3, 'the result', 'as told')


class FakePublisher:
    """As rospy's: the connection of a node that has died is there until somebody checks."""

    def __init__(self, *nodes, dead=()):
        self.impl = self
        self._nodes = set(nodes)
        self._dead = set(dead)

    def check(self):
        self._nodes -= self._dead

    def has_connection(self, node):
        return node in self._nodes


def test_a_connection_to_a_node_that_has_died_reaches_nobody():
    assert reaches(FakePublisher('/by_hand'), '/by_hand')
    assert not reaches(FakePublisher('/by_hand', dead=['/by_hand']), '/by_hand')
    assert not reaches(FakePublisher('/other'), '/by_hand')


class FakeConnection:
    def __init__(self, node):
        self.callerid_pub = node
        self.socket = object()


class FakeSubscriber:
    """To the nodes named."""

    def __init__(self, *nodes):
        self.impl = self
        self.connections = [FakeConnection(node) for node in nodes]


class FakeClient:
    def __init__(self):
        self.pub_goal, self.pub_cancel = FakePublisher('/server'), FakePublisher('/server')
        self.status_sub, self.result_sub, self.feedback_sub = (
            FakeSubscriber('/server') for _ in range(3)
        )


@pytest.fixture
def client(monkeypatch):
    """What a link is made of, connected to a server."""
    monkeypatch.setattr(connections, 'GRACE_S', 0.2)
    for kind in ('Publisher', 'Subscriber'):
        monkeypatch.setattr(rospy, kind, lambda *_, **__: None)
    client = FakeClient()
    monkeypatch.setattr(goal_link, 'ServedClient', lambda *_: client)
    return client


@pytest.fixture
def link(client):
    return GoalLink('/server', SharedAutonomyAction)


def ready_after_s(link):
    begin = time.monotonic()
    assert link.ready()
    return time.monotonic() - begin


def test_a_new_connection_is_given_time_to_be_known_to_the_server(link):
    assert ready_after_s(link) >= 0.2
    assert ready_after_s(link) < 0.2, 'but once'


@pytest.mark.parametrize(
    'made_anew',
    [
        lambda client: setattr(client, 'result_sub', FakeSubscriber('/server')),
        lambda client: setattr(client.result_sub.connections[0], 'socket', object()),
    ],
)
def test_a_connection_made_anew_is_given_that_time_again(client, link, made_anew):
    link.ready()
    made_anew(client)
    assert ready_after_s(link) >= 0.2


@pytest.mark.parametrize('topic', ['status_sub', 'result_sub', 'feedback_sub'])
def test_a_topic_without_the_server_is_waited_for(client, link, topic):
    (connection,) = getattr(client, topic).connections
    connection.callerid_pub = '/another'
    assert not link.ready()
    connection.callerid_pub, connection.socket = '/server', None
    assert not link.ready(), 'a connection whose socket is gone'


def test_a_node_that_reports_about_goals_and_takes_none_is_named_once(monkeypatch):
    warnings = []
    monkeypatch.setattr(
        goal_link.rospy, 'logwarn', lambda text, *args: warnings.append(text % args)
    )
    monkeypatch.setattr(goal_link.rospy, 'resolve_name', str)
    monkeypatch.setattr(goal_link, 'LISTENS_AFTER_S', 0.02)
    monkeypatch.setattr(
        actionlib.ActionClient, '__init__', lambda self, ns, _: setattr(self, 'ns', ns)
    )
    taken = []
    monkeypatch.setattr(actionlib.ActionClient, '_status_cb', lambda _, told: taken.append(told))
    client = ServedClient('/server', SharedAutonomyAction)

    def hear(node, *listeners):
        connections = [SimpleNamespace(endpoint_id=each) for each in listeners]
        client.pub_goal = SimpleNamespace(impl=SimpleNamespace(connections=connections))
        client._status_cb(SimpleNamespace(_connection_header={'callerid': node}))

    hear('/server')
    time.sleep(0.03)  # it listens only now
    hear('/server', '/server')
    hear('/server')
    assert len(taken) == 1 and not warnings, 'its connections come and go one after the other'
    for _ in range(3):
        hear('/relay', '/server')
        time.sleep(0.03)  # longer than any connection takes
    assert len(taken) == 1
    assert warnings == [
        '/server: ignored what /relay reports about goals, as it does not '
        'listen for them. A bag that is played does that'
    ]
