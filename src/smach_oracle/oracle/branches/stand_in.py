"""Stands in for a branch's state while its Concurrence or Iterator executes."""

import threading
from typing import Any, Callable, Optional, cast

import smach

from ..machine.tree_node import WrappedMachine
from .branch_machine import run_branch


class StandIn:
    """Executes a branch through its oracle. In all else it is the user's state.

    Its own place is in the container's tables alone, and only while that executes. Whoever asks the
    container for its children gets the user's states.
    """

    def __init__(
        self,
        state: smach.State,
        machine: Optional[WrappedMachine],
        note_outcome: Callable[[object], None],
        note_begin: Optional[Callable[[], None]] = None,
    ) -> None:
        """`machine`: the branch's, None for a state that has no oracle of its own here."""
        self._state = state
        self._machine = machine
        self._note_outcome = note_outcome
        self._note_begin = note_begin
        self._lock = threading.Lock()
        self._is_under_way = False

    def execute(self, userdata: smach.UserData) -> object:
        """Execute the state, and recover where it fails. Return its outcome."""
        if self._note_begin is not None:
            self._note_begin()
        # at once where it can be: each of the Iterators that lie in each other takes these frames
        outcome = (
            self._state.execute(userdata)
            if self._machine is None
            else self._execute(self._machine, userdata)
        )
        self._note_outcome(outcome)
        return outcome

    def _execute(self, machine: WrappedMachine, userdata: smach.UserData) -> object:
        with self._lock:
            begins = not self._is_under_way
            if begins:
                self._is_under_way = True
                pending = self._state.preempt_requested()
        if not begins:
            return self._state.execute(userdata)
        try:
            return run_branch(machine, pending)
        finally:
            with self._lock:
                self._is_under_way = False

    def request_preempt(self) -> None:
        """Preempt the state, or its recovery."""
        with self._lock:
            machine = self._machine if self._is_under_way else None
            if machine is None:
                self._state.request_preempt()
        if machine is not None:
            machine.request_preempt()

    def preempt_requested(self) -> bool:
        """Whether a request was not serviced."""
        machine = self._machine
        return self._state.preempt_requested() or (
            machine is not None and machine._preempt_requested
        )

    def recall_preempt(self) -> None:
        """Take a request back."""
        self._state.recall_preempt()
        if self._machine is not None:
            self._machine._preempt_requested = False

    def __getattr__(self, name: str) -> Any:
        if name in ('_state', '_machine'):
            raise AttributeError(name)
        return getattr(self._state, name)

    # that of the user's state, as `isinstance` sees it
    __class__ = cast(Any, property(lambda self: type(self._state)))


def real(state: object) -> Any:
    """Return the user's state, whatever stands in for it."""
    return state._state if type(state) is StandIn else state
