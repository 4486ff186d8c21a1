"""What a controller does with goals that come and go, without a node."""

import threading
from types import SimpleNamespace
from typing import Any, List

import pytest
from actionlib.server_goal_handle import ServerGoalHandle
from actionlib_msgs.msg import GoalID, GoalStatus

from control_msgs.msg import GripperCommandAction, GripperCommandActionGoal
from smach_oracle.simulation.node import controllers
from smach_oracle.simulation.node.motion_table import MotionTable
from smach_oracle.simulation.physics.trajectory import MotionResult


class Handle(ServerGoalHandle):
    """actionlib's own, so that comparing is as there; it notes how it ends instead of telling a
    server.
    """

    def __init__(self, name: str) -> None:
        goal = GripperCommandActionGoal(goal_id=GoalID(id=name))
        super().__init__(
            SimpleNamespace(goal=goal, status=GoalStatus(goal_id=goal.goal_id)),
            SimpleNamespace(lock=threading.RLock()),
            None,
        )
        self.goal = goal
        self.ends: List[str] = []

    def set_accepted(self, text: str = '') -> None:
        """Nobody to tell."""

    def set_rejected(self, result: Any = None, text: str = '') -> None:
        self.ends.append('rejected')

    def set_succeeded(self, result: Any = None, text: str = '') -> None:
        self.ends.append('succeeded')

    def set_canceled(self, result: Any = None, text: str = '') -> None:
        self.ends.append('canceled')


class Step:
    """A motion that ends after one period."""

    def __init__(self) -> None:
        self._ticks = 0

    def tick(self, world: Any) -> Any:
        self._ticks += 1
        return MotionResult(True) if self._ticks > 1 else None

    def events(self) -> tuple:
        return ()

    def stop(self, world: Any) -> None:
        """It moves nothing."""


@pytest.fixture(name='table')
def _table():
    return MotionTable(
        SimpleNamespace(step=lambda: None, happened=lambda *events: None, disturbed=False)
    )


@pytest.fixture(name='server')
def _server(table, monkeypatch):
    """What a controller gives its action server to call: `begin` and `cancel`."""
    server = SimpleNamespace(start=lambda: None)

    def make_server(name, spec, begin, cancel, **_):
        server.begin, server.cancel = begin, cancel
        return server

    monkeypatch.setattr(controllers.actionlib, 'ActionServer', make_server)

    def make(goal: Any) -> Step:
        if goal.command.position < 0:
            raise ValueError('no such gap')
        return Step()

    loop = SimpleNamespace(post=lambda call: call())
    controllers.Controller(
        'gripper',
        GripperCommandAction,
        'right_gripper',
        loop,
        table,
        make,
        lambda motion, ending: None,
        lambda motion: None,
    )
    return server


def test_a_goal_that_is_cancelled_stops(server, table):
    handle = Handle('one')
    server.begin(handle)
    server.cancel(handle)
    assert handle.ends == ['canceled'] and not table


def test_a_cancel_that_comes_when_its_goal_has_ended_is_no_matter(server, table):
    handle, refused = Handle('one'), Handle('two')
    server.begin(handle)
    table.tick()
    table.tick()
    server.cancel(handle)  # it was on its way when the motion ended
    refused.goal.goal.command.position = -1.0
    server.begin(refused)
    server.cancel(refused)
    assert handle.ends == ['succeeded'] and refused.ends == ['rejected']
