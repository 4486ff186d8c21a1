"""The goal of an action state as actionlib's users know it."""

import threading
from typing import Any

import actionlib
from actionlib import SimpleGoalState


class StateClient(actionlib.SimpleActionClient):
    """The SimpleActionClient at ``SimpleActionState._action_client``, for the state's latest goal.

    It shares the connection of all states of the action, so that having one costs no topics. A goal
    that a script sends through it takes the place of the state's for its methods.
    """

    def __init__(self, client: actionlib.ActionClient) -> None:
        # not SimpleActionClient's own: it would connect a second time
        self.action_client = client
        self.simple_state = SimpleGoalState.DONE
        self.gh: Any = None
        self.done_condition = threading.Condition()
        self.done_cb = self.active_cb = self.feedback_cb = None

    def follow(self, handle: Any) -> None:
        """Follow the goal of this handle from now on."""
        self.gh = handle
        self.simple_state = SimpleGoalState.ACTIVE

    def ended(self) -> None:
        """Note that the state's goal has ended, or is tracked no more."""
        with self.done_condition:
            self.simple_state = SimpleGoalState.DONE
            self.done_condition.notify_all()
