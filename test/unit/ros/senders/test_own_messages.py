"""A topic belongs to one of the nodes that publish on it: a bag may be played beside the robot."""

from types import SimpleNamespace

import pytest

from smach_oracle.msg import ExpertQueryAction
from smach_oracle.ros.expert import quiet_action_server
from smach_oracle.ros.expert.quiet_action_server import QuietActionServer
from smach_oracle.ros.senders import own_messages
from smach_oracle.ros.senders.own_messages import OwnMessages, listens, owner_of


def of(node, **fields):
    """A message of a node."""
    return SimpleNamespace(_connection_header={'callerid': node}, **fields)


@pytest.mark.parametrize(
    'topic, nodes, owner',
    [
        ('/task/oracle/events', ['/play_1', '/task'], '/task'),
        ('/lab/task/oracle/events', ['/lab', '/lab/task', '/play_1'], '/lab/task'),
        ('/task/oracle/events', ['/relay', '/play_1'], '/relay'),
        ('/tasks/oracle/events', ['/relay', '/task'], '/relay'),
        ('/task/oracle/events', ['/play_1'], '/play_1'),
        ('/task/oracle/events', [], ''),
    ],
)
def test_a_topic_belongs_to_the_node_after_which_it_is_named_or_that_was_first(topic, nodes, owner):
    assert owner_of(topic, nodes) == owner


@pytest.fixture(name='warnings')
def collected_warnings(monkeypatch):
    texts = []
    monkeypatch.setattr(own_messages, '_named', set())
    for module in (own_messages, quiet_action_server):
        monkeypatch.setattr(module.rospy, 'logwarn', lambda text, *args: texts.append(text % args))
    return texts


def test_messages_of_others_are_ignored_while_the_owner_is_there_and_named_once(
    warnings, monkeypatch
):
    nodes = ['/play_1', '/task']
    monkeypatch.setattr(own_messages, 'publishers_of', lambda topic: nodes)
    taken = []
    for topic in ('/task/oracle/events', '/task/oracle/rates'):
        receive = OwnMessages(topic, lambda message: taken.append(own_messages.sender_of(message)))
        for node in ('/task', '/play_1', '/play_1', ''):
            receive(of(node))
    assert taken == ['/task', '', '/task', '']
    assert warnings == [
        '/play_1 publishes on topics of /task, such as /task/oracle/events: its messages are '
        'ignored. A bag that is played beside the robot does that'
    ]
    nodes.remove('/task')
    receive(of('/play_1'))
    assert taken[-1] == '/play_1', 'nobody else is there'


def publisher_to(*nodes):
    return SimpleNamespace(
        impl=SimpleNamespace(connections=[SimpleNamespace(endpoint_id=node) for node in nodes])
    )


def test_a_node_listens_where_it_has_a_connection():
    assert listens(publisher_to('/a', '/b'), '/b') and not listens(publisher_to('/a'), '/b')
    assert not listens(SimpleNamespace(impl=None), '/b'), 'the topic is closed'


@pytest.mark.parametrize(
    'message, counts',
    [
        (of('/asker', goal=1), True),
        (of('', goal=1), True),
        (of('/play_1', goal=1), False),
        (of('/asker', id=''), True),
        (of('/play_1', id=''), False),
        (of('/gone', id='goal 7'), True),
    ],
)
def test_a_goal_counts_only_of_a_node_that_listens_for_its_result(
    message, counts, warnings, monkeypatch
):
    taken = []
    for name in ('internal_goal_callback', 'internal_cancel_callback'):
        monkeypatch.setattr(
            quiet_action_server.actionlib.ActionServer,
            name,
            lambda self, received: taken.append(received),
        )
    monkeypatch.setattr(quiet_action_server, 'LISTENS_AFTER_S', 0.02)
    monkeypatch.setattr(quiet_action_server.rospy, 'resolve_name', str)
    server = QuietActionServer('/ask', ExpertQueryAction, print, auto_start=False)
    server.result_pub = publisher_to('/asker')
    (
        server.internal_goal_callback
        if hasattr(message, 'goal')
        else server.internal_cancel_callback
    )(message)
    assert taken == [message] * counts and len(warnings) == (not counts)
