"""The public methods that a machine calls at every step only if somebody put others in their
place.
"""

from typing import Any

from smach.container import Container
from smach.state import State

_HOOKS = {
    'preempt_requested': State.preempt_requested,
    'call_transition_cbs': Container.call_transition_cbs,
}


def is_hooked(machine: Any) -> bool:
    """Whether one of them was overridden or patched."""
    return any(
        getattr(getattr(machine, name), '__func__', None) is not method
        for name, method in _HOOKS.items()
    )
