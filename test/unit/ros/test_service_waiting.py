"""Waits that are passed through a service: what it lets pass, and what is waited for."""

import types

import pytest
import rospy

from smach_oracle.oracle.scope.scope import Reason, Scope
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.ros.waiting import service_waiting
from smach_oracle.ros.waiting.service_waiting import ServiceWaiting


class World:
    """A fake of a world with a service: each call lets `passes` of the time pass."""

    def __init__(self, monkeypatch, passes=1.0, error=None, then=lambda: None):
        self.now_s = 100.0
        self.asked = []
        self.waited = []
        self._passes = passes
        self._error = error
        self._then = then
        monkeypatch.setattr(rospy, 'get_time', lambda: self.now_s)
        monkeypatch.setattr(rospy, 'logwarn', lambda *args: None)
        monkeypatch.setattr(service_waiting, 'ServiceCall', self._call)
        self.waiting = ServiceWaiting('/world/pass_time')
        monkeypatch.setattr(self.waiting, '_by_itself', self)

    def _call(self, name, kind, request):
        self.asked.append((name, request.seconds, request.what))
        self.now_s += request.seconds * self._passes
        self._then()
        return self

    def is_alive(self):
        return False

    def result(self, limit_s):
        if self._error is not None:
            raise self._error
        return types.SimpleNamespace(stamp=rospy.Time(self.now_s))

    def wait(self, seconds, what, scope):
        """What the oracle waits for by itself."""
        self.waited.append(pytest.approx(seconds))


def test_time_passes_by_the_service_in_pieces(monkeypatch):
    world = World(monkeypatch)
    world.waiting.wait(2.5, 'to try PICK again', Scope())
    assert world.asked == [
        ('/world/pass_time', seconds, 'to try PICK again') for seconds in (1.0, 1.0, 0.5)
    ]
    assert world.waited == [] and world.now_s == 102.5


def test_what_a_world_with_a_pace_does_not_let_pass_is_waited_for(monkeypatch):
    world = World(monkeypatch, passes=0.0)
    world.waiting.wait(1.5, '', Scope())
    assert world.waited == [1.0, 0.5]


def test_without_the_service_all_of_it_is_waited_for(monkeypatch):
    world = World(monkeypatch, error=ServerGoneError('gone'))
    world.waiting.wait(5.0, '', Scope())
    assert (len(world.asked), world.waited) == (1, [5.0])


def test_a_service_that_is_not_there_is_named_once(monkeypatch):
    warnings = []
    world = World(monkeypatch, error=ServerGoneError('/world/pass_time: gone for good'))
    monkeypatch.setattr(rospy, 'logwarn', lambda *args: warnings.append(args[0] % args[1:]))
    for _ in range(3):
        world.waiting.wait(5.0, '', Scope())
    assert len(warnings) == 1 and 'gone for good; the oracle waits without it' in warnings[0]


def test_a_preempt_between_two_pieces_ends_the_wait(monkeypatch):
    scope = Scope()
    world = World(monkeypatch, then=lambda: scope.cancel(Reason.PREEMPTED))
    world.waiting.wait(5.0, '', scope)
    assert len(world.asked) == 1
