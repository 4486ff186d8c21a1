"""The part of a SMACH machine that the executive relies on, private names among it.

Both engines have these members, upstream's and our own. The private ones are those that public
scripts and tools use too.
"""

from types import TracebackType
from typing import Any, Dict, List, Mapping, Optional, Protocol, Tuple, Type

import smach

Labels = Tuple[str, ...]
Transitions = Dict[str, Optional[str]]


class StepLock(Protocol):
    """The lock that a machine holds while it moves from one state to the next."""

    def acquire(self) -> bool:
        """Wait for the lock."""

    def release(self) -> None:
        """Give the lock back."""

    def __enter__(self) -> bool:
        """Acquire it."""

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        err: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        """Release it."""


class Machine(Protocol):
    """A `smach.StateMachine` as the executive sees it."""

    userdata: smach.UserData
    _states: Dict[str, smach.State]
    _transitions: Dict[str, Transitions]
    _remappings: Dict[str, Mapping[str, str]]
    _constants: Dict[str, Mapping[str, Any]]
    _initial_state_label: Optional[str]
    _current_label: Optional[str]
    _current_state: Optional[smach.State]
    _current_transitions: Optional[Transitions]
    _is_running: bool
    _preempt_requested: bool
    _preempted_label: Optional[str]
    _preempted_state: Optional[smach.State]
    _is_preempt_passed_on: bool  # our engine's alone. Upstream's never reads it

    @property
    def _state_transitioning_lock(self) -> StepLock:
        """Re-entrant on our engine, plain on upstream's."""

    def get_registered_outcomes(self) -> Tuple[str, ...]:
        """Return the container outcomes."""

    def is_running(self) -> bool:
        """Whether it is being executed."""

    def preempt_requested(self) -> bool:
        """Whether somebody has asked it to stop."""

    def request_preempt(self) -> None:
        """Ask it to stop."""

    def service_preempt(self) -> None:
        """Note that the request was obeyed."""

    def call_transition_cbs(self) -> None:
        """Tell the transition callbacks."""

    def call_termination_cbs(self, terminal_states: List[str], outcome: Any) -> None:
        """Tell the termination callbacks."""

    def _set_current_state(self, state_label: Optional[str]) -> None:
        """Make a state the current one. None means none."""
