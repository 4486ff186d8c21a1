"""Finds out how the engine works that executes a machine."""

import smach

from ..identity import WeakIdentityMap
from .protocols import Machine

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
        self.has_own_loop = _has_own_loop(machine)


def _has_own_loop(machine: Machine) -> bool:
    """Whether nobody but SMACH and this package has a say in how a machine steps."""
    step = getattr(machine, '_update_once', None)
    return getattr(step, '__func__', None) is getattr(
        type(machine), '_update_once', None
    ) and _steps_as_drawn(type(machine))


def _steps_as_drawn(cls: type) -> bool:
    known = _STEP_AS_DRAWN.get(cls)
    if known is None:
        known = _STEP_AS_DRAWN[cls] = all(
            each.__module__.partition('.')[0] in ('smach', 'smach_oracle')
            for each in cls.__mro__
            if 'execute' in vars(each) or '_update_once' in vars(each)
        )
    return known
