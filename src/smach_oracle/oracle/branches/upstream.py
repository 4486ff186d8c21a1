"""Containers whose class asks no hook: upstream's, and those of users that execute by themselves.

All that stands in there does so here: a class made of the container's own, and stand-ins in the
tables in which it keeps its states while it executes.
"""

from typing import Any, Dict, Mapping, Optional, Tuple, cast

import smach

from ..identity import set_class
from ..machine.items import TrackedItems
from ..machine.wrapped_classes import rebuild, two_classes, wrapped_class
from ..smach_private import (
    items_of,
    iterated_label_of,
    iterated_state_of,
    set_items,
    set_states,
    states_of,
)
from .branch import Branch

HOOK = 'execution_hook'  # the attribute by which our engine asks


def asks_hook(cls: type) -> bool:
    """Whether containers of a class ask their `execution_hook`, as those of our engine do.

    A class that preempts the states by itself finds no runners there.
    """
    execute = getattr(cls, 'execute', None)
    request_preempt = getattr(cls, 'request_preempt', None)
    kinds: Tuple[Any, ...] = (smach.Concurrence, smach.Iterator)
    return hasattr(smach.Container, HOOK) and any(
        execute is kind.execute and request_preempt is kind.request_preempt for kind in kinds
    )


def have_asked(container: smach.Container) -> None:
    """Have a container ask its hook, by a class made for that.

    :raises TypeError: where its class cannot be extended.
    """
    if not issubclass(type(container), _Asking):  # as a shallow copy of another one is
        set_class(container, wrapped_class(_Asking, type(container)))


def ask_no_more(container: smach.Container) -> None:
    """Give a container its own class back."""
    made_of = two_classes(type(container))
    if made_of is not None:
        set_class(container, made_of[1])


class _BranchMethod:
    """A method of the branch of a stand-in, without a frame of its own on the stack."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, stand_in: Any, owner: type) -> Any:
        return self if stand_in is None else getattr(stand_in.branch_of_stand_in, self._name)


class BranchStandIn:
    """Executes by a branch. In all else it is the user's state.

    Its place is in the tables of a container alone, and only while that executes. Whoever asks the
    container for its children gets the user's states.
    """

    def __init__(self, branch: Branch, state: smach.State) -> None:
        # names that no user's state has: they would hide its own
        self.branch_of_stand_in = branch
        self.state_of_stand_in = state

    execute = _BranchMethod('execute')
    request_preempt = _BranchMethod('request_preempt')
    recall_preempt = _BranchMethod('recall_preempt')

    def preempt_requested(self) -> bool:
        """Whether the branch or the state has a request that was not serviced."""
        branch, state = self.branch_of_stand_in, self.state_of_stand_in
        return bool(branch.preempt_requested() or state.preempt_requested())

    def __getattr__(self, name: str) -> Any:
        if name in ('branch_of_stand_in', 'state_of_stand_in'):  # while it is copied
            raise AttributeError(name)
        return getattr(self.state_of_stand_in, name)

    # that of the user's state: upstream's Iterator, and users, ask for it by `isinstance`
    __class__ = cast('Any', property(lambda self: type(self.state_of_stand_in)))


def _users_state(state: object) -> Any:
    """Return the user's state, whatever stands in for it."""
    return state.state_of_stand_in if type(state) is BranchStandIn else state


class _Asking:
    """A Concurrence or an Iterator that asks its hook. In all else it is what its own class is."""

    _oracle_wrapper: Any

    def execute(self, *args: object, **kwargs: Any) -> Optional[str]:
        base: Any = super()
        hook = self._oracle_wrapper

        with hook.execution(self) as execution:
            own = _stand_in(self, hook) if execution.is_entered else None
            try:
                execution.outcome = base.execute(*args, **kwargs)
            finally:
                if own is not None:
                    _give_back(self, own)
        outcome: Optional[str] = execution.outcome
        return outcome

    def get_children(self) -> Dict[str, smach.State]:
        base: Any = super()
        children: Dict[str, smach.State] = base.get_children()
        if self._oracle_wrapper.runners:
            return {label: _users_state(state) for label, state in children.items()}
        return children

    def __getitem__(self, label: str) -> smach.State:
        base: Any = super()
        state: smach.State = _users_state(base.__getitem__(label))
        return state

    def __reduce_ex__(self, protocol: Any) -> Tuple[object, ...]:
        """Make the class again on unpickling: a class made here cannot be found by name."""
        base: Any = super()
        reduced = base.__reduce_ex__(max(2, protocol))
        return (rebuild, two_classes(type(self)), _at_rest(dict(reduced[2]))) + tuple(reduced[3:])

    def _copy_input_keys(self, parent_ud: Optional[smach.UserData], ud: smach.UserData) -> None:
        def copy() -> None:
            super(_Asking, self)._copy_input_keys(parent_ud, ud)  # type: ignore[misc]

        self._oracle_wrapper.take_inputs(self, copy, parent_ud)


Tables = Tuple[Any, Optional[smach.State], Mapping[str, smach.State]]


def _stand_in(container: Any, hook: Any) -> Tables:
    """Put stand-ins into the tables of a container, and return what was there."""

    def of(label: str, state: Optional[smach.State]) -> Any:
        if state is None:
            return None
        runner = hook.runner_of(container, label, state)
        return BranchStandIn(runner, state) if isinstance(runner, Branch) else state

    if isinstance(container, smach.Iterator):
        own = items_of(container), iterated_state_of(container)
        set_items(container, hook.tracked, of(iterated_label_of(container), own[1]))
        return (*own, {})
    states = states_of(container)
    set_states(container, {label: of(label, state) for label, state in states.items()})
    return None, None, states


def _give_back(container: Any, own: Tables) -> None:
    """Put back what was there, unless the user has put in something else meanwhile."""
    items, state, states = own
    if not isinstance(container, smach.Iterator):
        set_states(container, states)
        return
    now = items_of(container), iterated_state_of(container)
    set_items(
        container,
        items if isinstance(now[0], TrackedItems) else now[0],
        state if type(now[1]) is BranchStandIn else now[1],
    )


def _at_rest(attributes: Dict[str, Any]) -> Dict[str, object]:
    """Return the attributes of a container for a copy, as they are while it is at rest."""
    if '_states' in attributes:
        attributes['_states'] = {
            label: _users_state(state) for label, state in attributes['_states'].items()
        }
    if '_state' in attributes:
        attributes['_state'] = _users_state(attributes['_state'])
    items = attributes.get('_items')
    if isinstance(items, TrackedItems):
        attributes['_items'] = items.given
    return attributes
