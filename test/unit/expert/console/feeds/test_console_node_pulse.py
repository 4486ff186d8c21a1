"""Nodes are asked whether they live; one that hangs holds up no other."""

import threading

import pytest
from waiting import wait_for

from smach_oracle.expert.console.feeds import node_pulse
from smach_oracle.expert.console.feeds.node_pulse import NodePulse


class Nodes:
    """Of which some hang and some are dead."""

    def __init__(self):
        self.hanging, self.dead = set(), set()
        self.go_on = threading.Event()
        self.asked = []

    def link(self, node):
        self.asked.append(node)

        def ask():
            if node in self.hanging:
                self.go_on.wait(20.0)
            if node in self.dead:
                raise ConnectionRefusedError(node)

        link = type('Link', (), {})()
        link.ask = ask
        return link


@pytest.fixture(name='nodes')
def make_nodes():
    made = Nodes()
    yield made
    made.go_on.set()


def test_a_node_that_hangs_holds_up_no_other(nodes):
    nodes.hanging = {'/hangs'}
    pulse = NodePulse(nodes.link, 0.01)
    pulse.follow(['/hangs', '/lives'])
    first_s = wait_for(lambda: pulse.heard_s('/lives'))
    assert first_s and wait_for(lambda: pulse.heard_s('/lives') > first_s)
    assert pulse.heard_s('/hangs') is None
    pulse.follow([])


def test_a_node_that_died_is_heard_no_later(nodes):
    pulse = NodePulse(nodes.link, 0.01)
    pulse.follow(['/dies'])
    assert wait_for(lambda: pulse.heard_s('/dies'))
    nodes.dead = {'/dies'}
    pulse.follow(['/dies', '/lives'])
    assert wait_for(lambda: pulse.heard_s('/lives'))
    last_s = pulse.heard_s('/dies')
    first_s = pulse.heard_s('/lives')
    assert wait_for(lambda: pulse.heard_s('/lives') > first_s + 0.05)
    assert pulse.heard_s('/dies') <= first_s or pulse.heard_s('/dies') == last_s
    assert nodes.asked == ['/dies', '/lives'], 'each has one thread'
    pulse.follow([])


def test_who_is_followed_no_longer_is_asked_no_longer(nodes):
    pulse = NodePulse(nodes.link, 0.01)
    pulse.follow(['/one'])
    assert wait_for(lambda: pulse.heard_s('/one'))
    pulse.follow([])
    assert wait_for(lambda: pulse.heard_s('/one') is None)


def test_its_address_is_looked_up_again_once_it_does_not_answer(monkeypatch):
    uris, asked = iter(['http://old', 'http://new']), []

    class Proxy:
        def __init__(self, uri):
            self._uri = uri

        def getPid(self, caller):
            asked.append(self._uri)
            if self._uri == 'http://old' and len(asked) > 1:
                raise ConnectionRefusedError

        def lookupNode(self, caller, node):
            return 1, '', next(uris)

    monkeypatch.setattr(node_pulse, '_proxy', Proxy)
    link = node_pulse.NodeLink('/robot')
    link.ask()
    with pytest.raises(ConnectionRefusedError):
        link.ask()
    link.ask()
    assert asked == ['http://old', 'http://old', 'http://new']


def test_a_node_that_the_master_does_not_know_is_none(monkeypatch):
    class Proxy:
        def __init__(self, uri):
            pass

        def lookupNode(self, caller, node):
            return -1, 'unknown node', ''

    monkeypatch.setattr(node_pulse, '_proxy', Proxy)
    with pytest.raises(node_pulse.NodeUnknownError, match='unknown node'):
        node_pulse.NodeLink('/robot').ask()
