"""A new connection counts once its publisher sends to it, however long that takes; no master."""

import threading
from types import SimpleNamespace
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rospy

from smach_oracle.ros import connections
from smach_oracle.ros.connections import ConnectionGrace

LIMIT_S = 20.0


class Publisher:
    """A node's own server, which lists a subscriber from the time it is told to."""

    def __init__(self):
        self.listed = []  # topics on which it sends to this node
        self.asked = threading.Semaphore(0)
        self._server = SimpleXMLRPCServer(('localhost', 0), logRequests=False)
        self._server.register_function(self.get_bus_info, 'getBusInfo')
        self.uri = 'http://localhost:{}/'.format(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def get_bus_info(self, caller):
        listed = [
            [number, caller, 'o', 'TCPROS', topic, True, 'text']
            for number, topic in enumerate(self.listed)
        ]
        self.asked.release()
        return [
            1,
            'bus info',
            listed
            + [
                [8, '/other', 'o', 'TCPROS', '/image', True, 'text'],
                [9, caller, 'i', 'TCPROS', '/image', True, 'text'],
            ],
        ]

    def close(self):
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def publisher(monkeypatch):
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(connections, 'GRACE_S', 0.01)
    made = Publisher()
    yield made
    made.close()


def connection(publisher, name='/image'):
    return SimpleNamespace(socket=object(), endpoint_id=publisher.uri, name=name)


def begun(grace, *new):
    waiting = threading.Thread(target=grace.wait, args=(new,), daemon=True)
    waiting.start()
    return waiting


def test_a_publisher_that_does_not_send_yet_is_waited_for(publisher):
    waiting = begun(ConnectionGrace(), connection(publisher), connection(publisher, '/info'))
    for topics in ([], ['/info']):
        publisher.listed = topics
        # what it has answered by then may be of before
        assert all(publisher.asked.acquire(timeout=LIMIT_S) for _ in range(5))
        assert waiting.is_alive()
    publisher.listed = ['/info', '/image']
    waiting.join(LIMIT_S)
    assert not waiting.is_alive()


def test_who_was_known_is_not_asked_about_again(publisher):
    grace, known = ConnectionGrace(), connection(publisher)
    publisher.listed = ['/image']
    grace.wait([known])
    assert publisher.asked.acquire(timeout=LIMIT_S)
    grace.wait([known])
    assert not publisher.asked.acquire(blocking=False)
    known.socket = object()
    grace.wait([known])
    assert publisher.asked.acquire(blocking=False)


def test_a_publisher_that_never_lists_it_is_waited_for_so_long(publisher, monkeypatch):
    monkeypatch.setattr(connections, 'HANDSHAKE_S', 0.1)
    waiting = begun(ConnectionGrace(), connection(publisher))
    waiting.join(LIMIT_S)
    assert not waiting.is_alive()


@pytest.mark.parametrize('uri', ['http://localhost:1/', '/by_hand'])
def test_one_that_cannot_be_asked_gets_a_moment(publisher, monkeypatch, uri):
    slept = []
    monkeypatch.setattr(connections.time, 'sleep', slept.append)
    ConnectionGrace().wait([connection(SimpleNamespace(uri=uri))])
    assert slept == [0.01]
