"""Notes which goals this process has sent, before they are sent."""

import functools
from typing import Callable

import actionlib
import genpy
import rospy
from actionlib.action_client import CommStateMachine

from smach_oracle.oracle.records.running_goals import GOALS

_MARK = '_smach_oracle_notes'
# questions to an expert: they are asked again under their ids
_NOT_NOTED = ('smach_oracle/ExpertQueryActionGoal',)


def note_goals() -> None:
    """Note each goal of actionlib's clients from now on. It does nothing the second time."""
    client = actionlib.ActionClient
    if hasattr(client.send_goal, _MARK):
        return
    send_goal, set_state = client.send_goal, CommStateMachine.set_state

    @functools.wraps(send_goal)
    def note_and_send(self: actionlib.ActionClient, *args: object, **kwargs: object) -> object:
        _note_sent_by(self)
        return send_goal(self, *args, **kwargs)

    @functools.wraps(set_state)
    def note_state(self: CommStateMachine, state: int) -> None:
        set_state(self, state)
        if state == actionlib.CommState.DONE:
            GOALS.end(self.action_goal.goal_id.id)

    setattr(note_and_send, _MARK, True)
    client.send_goal = note_and_send
    CommStateMachine.set_state = note_state


def _note_sent_by(client: actionlib.ActionClient) -> None:
    """Have what a client publishes noted first."""
    publish = client.manager.send_goal_fn
    if not hasattr(publish, _MARK):
        client.manager.send_goal_fn = _noting(publish, client.ns)


def _noting(publish: Callable[[genpy.Message], None], name: str) -> Callable[[genpy.Message], None]:
    server = rospy.resolve_name(name)

    def note_and_publish(goal: genpy.Message) -> None:
        if goal._type not in _NOT_NOTED:
            GOALS.begin(goal.goal_id.id, server)
        publish(goal)

    setattr(note_and_publish, _MARK, True)
    return note_and_publish
