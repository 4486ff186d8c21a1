"""The part of a SMACH machine that the executive relies on, and how its engine steps.

Both engines have these members, upstream's and our own. The private ones are those that public
scripts and tools use too.
"""

from types import TracebackType
from typing import Any, Dict, List, Mapping, Optional, Protocol, Tuple, Type

import smach

from ..identity import WeakIdentityMap

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


_STEP_AS_DRAWN: WeakIdentityMap[type, bool] = WeakIdentityMap()


class EngineProbe:
    """Finds out how the SMACH engine steps, when an execution comes to its first state.

    `lock_is_held`: whether the engine holds the machine's lock around a step. `attentive`: whether
    a step begins with a closer look at preempt requests and at what an operator wants.
    `stays_attentive`: whether it does so in any case. `tells_transitions`: whether the machine's
    class wants every transition told. `has_own_loop`: whether the engine itself calls for the next
    step, and no class of a user's. `stepped`: whether this execution has come to a state.
    """

    __slots__ = (
        'stepped',
        'lock_is_held',
        'attentive',
        'stays_attentive',
        'tells_transitions',
        'has_own_loop',
    )

    def __init__(self) -> None:
        self.stepped = False
        self.lock_is_held = False
        self.attentive = True
        self.stays_attentive = True
        self.tells_transitions = True
        self.has_own_loop = False

    def begin_execution(self) -> None:
        """Forget what was seen: the next step looks again."""
        self.stepped = False
        self.attentive = True

    def look(self, machine: Machine) -> None:
        """Find out how this engine steps.

        Some engines hold the lock around a step, with a plain lock all do. Others leave it to the
        step.
        """
        self.stepped = True
        # of a re-entrant lock
        is_owned = getattr(machine._state_transitioning_lock, '_is_owned', None)
        self.lock_is_held = is_owned is None or is_owned()
        cls = type(machine)
        self.stays_attentive = cls.preempt_requested is not smach.State.preempt_requested
        self.attentive = self.stays_attentive
        self.tells_transitions = cls.call_transition_cbs is not smach.Container.call_transition_cbs
        # nobody but SMACH and this package has a say in how the machine steps
        step = getattr(machine, '_update_once', None)
        self.has_own_loop = getattr(step, '__func__', None) is getattr(
            cls, '_update_once', None
        ) and _steps_as_drawn(cls)


def _steps_as_drawn(cls: type) -> bool:
    known = _STEP_AS_DRAWN.get(cls)
    if known is None:
        known = _STEP_AS_DRAWN[cls] = all(
            each.__module__.partition('.')[0] in ('smach', 'smach_oracle')
            for each in cls.__mro__
            if 'execute' in vars(each) or '_update_once' in vars(each)
        )
    return known
