"""When an action server is given up, and when it is not. Time and the node's answers are faked."""

import pytest

pytest.importorskip('rospy')
pytest.importorskip('smach_ros')
from smach_common import node_probe
from smach_ros import server_watch


class FakeClock(object):
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


class FakeConnection(object):
    callerid_pub = '/server'
    endpoint_id = 'http://robot:1234/'
    socket = object()


class FakeSubscriber(object):
    def __init__(self):
        self.impl = self
        self.connections = [FakeConnection()]


class FakeStatus(object):
    _connection_header = {'callerid': '/server'}


class FakeNode(object):
    """Answers probes with ``verdict``; None: not yet."""

    def __init__(self):
        self.verdict, self.asked, self.waiting = node_probe.ALIVE, [], []

    def probe(self, uri, caller_id, answer):
        self.asked.append(uri)
        if self.verdict is None:
            self.waiting.append(answer)
        else:
            answer(self.verdict)


@pytest.fixture
def world():
    class World(object):
        clock, topic, node = FakeClock(), FakeSubscriber(), FakeNode()
        problem = None

        def status(self):
            self.watch.note_status(FakeStatus())

        def passes(self, seconds, step_s=0.1, status_every_s=None):
            """Let time pass, looking ten times a second; returns the first problem seen."""
            for i in range(int(round(seconds / step_s))):
                self.clock.now += step_s
                if status_every_s and i % int(round(status_every_s / step_s)) == 0:
                    self.status()
                problem = self.watch.problem()
                if problem:
                    return problem
            return None

    world = World()
    world.watch = server_watch.ServerWatch(world.topic, world.node.probe, world.clock)
    world.status()
    return world


def test_server_that_reports_is_never_asked(world):
    assert world.passes(60.0, status_every_s=0.2) is None
    assert world.node.asked == []


def test_killed_server_is_known_at_once(world):
    world.topic.connections = []
    world.node.verdict = node_probe.GONE
    assert 'nobody answers at http://robot:1234/' in world.passes(0.3)


def test_reconnecting_subscriber_is_a_lost_connection(world):
    world.topic.connections[0].socket = None
    world.node.verdict = node_probe.GONE
    assert 'is gone' in world.passes(0.3)


def test_silent_server_whose_node_answers_is_awaited_with_a_warning(world, monkeypatch):
    said = []
    monkeypatch.setattr(server_watch.smach, 'logwarn', said.append)
    assert world.passes(600.0) is None
    assert len(said) == 1 and '/server' in said[0]
    world.status()
    assert world.passes(10.0) is None
    assert len(said) == 2


def test_node_is_asked_about_once_a_second_and_never_twice_at_a_time(world):
    world.passes(12.0)
    assert 9 <= len(world.node.asked) <= 11
    world.node.verdict = None
    world.passes(10.0)
    assert len(world.node.waiting) == 1


def test_frozen_server_is_given_up_after_its_time_only(world):
    world.node.verdict = node_probe.NO_ANSWER
    assert world.passes(server_watch.FROZEN_AFTER_S - 1.0) is None
    assert 'no sign of life' in world.passes(3.0)


def test_server_that_thaws_is_kept(world):
    world.node.verdict = node_probe.NO_ANSWER
    assert world.passes(20.0) is None
    world.status()
    world.node.verdict = node_probe.ALIVE
    assert world.passes(60.0) is None


def test_answer_that_was_overtaken_by_a_status_is_void(world):
    world.node.verdict = None
    world.passes(3.0)
    world.status()
    world.node.waiting[0](node_probe.GONE)
    assert world.passes(0.5) is None


def test_living_node_that_closed_its_status_topic_is_given_up_after_a_while(world):
    world.topic.connections = []
    assert world.passes(server_watch.WITHDRAWN_AFTER_S - 1.0) is None
    assert 'no longer serves' in world.passes(3.0)


def test_status_from_a_successor_ends_all_suspicion(world):
    world.topic.connections = []
    world.node.verdict = node_probe.GONE
    assert world.passes(0.3)
    world.topic.connections = [FakeConnection()]
    world.topic.connections[0].endpoint_id = 'http://robot:4321/'
    world.status()
    assert world.passes(1.0, status_every_s=0.2) is None
    world.topic.connections = []
    assert 'http://robot:4321/' in world.passes(0.3)


def test_probe_tells_a_closed_port_from_a_silent_one():
    import socket

    listener = socket.socket()
    listener.bind(('127.0.0.1', 0))
    uri = 'http://127.0.0.1:%d/' % listener.getsockname()[1]
    assert node_probe.probe_node(uri, '/me') == node_probe.GONE
    listener.listen(1)
    assert node_probe.probe_node(uri, '/me') == node_probe.NO_ANSWER
    listener.close()
