"""Servers come and go: a front end that finds them forgets those that are gone for good; no master."""
import pytest

from smach_oracle.expert import front_end as module
from smach_oracle.expert.followed_server import Listed, ServerGoneError
from smach_oracle.expert.front_end import FrontEnd
from smach_oracle.msg import OpenQueries

LIST = ['/robot/expert_query/open', OpenQueries._type]


class FakeServer:
    """A server that is followed."""

    def __init__(self, name, _on_change):
        self.name = name
        self.connected = True
        self.stopped = False

    def refresh(self, advertised):
        """Nothing to be done."""

    def stop(self):
        self.stopped = True

    def questions(self):
        return []


@pytest.fixture(name='clock')
def make_clock(monkeypatch):
    """A clock to be set; nothing looks by itself."""
    class Clock:
        now_s = 0.0
    monkeypatch.setattr(module, 'FollowedServer', FakeServer)
    monkeypatch.setattr(module.time, 'monotonic', lambda: Clock.now_s)
    for name in ('_keep_connected', '_keep_claims'):
        monkeypatch.setattr(FrontEnd, name, lambda self: None)
    monkeypatch.setattr(module.rospy, 'resolve_name', lambda name: name)
    return Clock


def look_after(front_end, clock, seconds, *published):
    clock.now_s += seconds
    front_end._look_for_servers(published)


def test_a_server_that_is_gone_for_good_is_forgotten_and_found_again(clock):
    front_end = FrontEnd('ann')
    look_after(front_end, clock, 0.0, LIST)
    server, = front_end._servers.values()
    server.connected = False
    look_after(front_end, clock, 1.0)
    look_after(front_end, clock, module._FORGET_S - 10.0)
    assert front_end.servers == ['/robot/expert_query'], 'it may be restarted'
    look_after(front_end, clock, 20.0)
    assert front_end.servers == [] and server.stopped
    with pytest.raises(ServerGoneError, match='/robot/expert_query is gone'):
        front_end.server(Listed('/robot/expert_query', None, 0, '', 0.0, 0.0))
    look_after(front_end, clock, 1.0, LIST)
    assert front_end.servers == ['/robot/expert_query']


def test_one_that_was_away_for_a_while_begins_anew(clock):
    front_end = FrontEnd('ann')
    look_after(front_end, clock, 0.0, LIST)
    next(iter(front_end._servers.values())).connected = False
    for seconds, published in ((1.0, []), (module._FORGET_S - 10.0, [LIST]), (20.0, []), (20.0, [])):
        look_after(front_end, clock, seconds, *published)
    assert front_end.servers == ['/robot/expert_query']


def test_one_that_was_named_is_followed_for_ever(clock):
    front_end = FrontEnd('ann', ['/robot/expert_query'])
    next(iter(front_end._servers.values())).connected = False
    for _ in range(3):
        look_after(front_end, clock, 2 * module._FORGET_S)
    assert front_end.servers == ['/robot/expert_query']
