"""Gives the plain states of the Concurrences and Iterators of a wrapped tree their machines."""

from typing import Callable, Dict, Iterator, Optional, Tuple, cast

import smach

from ..identity import own_attributes
from ..machine.nesting import WRAPPER, branching_below
from ..machine.tree_node import TreeNode, marked_node
from ..smach_private import Labels
from .branch import BranchSite, ConcurrenceSite, IteratorSite
from .branch_machine import BranchMachine
from .upstream import HOOK, ask_no_more, asks_hook, have_asked
from .wrapper import ConcurrenceWrapper, ContainerWrapper, IteratorWrapper, wrapper_of

PutUnder = Callable[[smach.StateMachine, TreeNode], smach.StateMachine]


def adopt_branches(parent: TreeNode, put_under: PutUnder) -> None:
    """Put the branches below a wrapped machine, down to the next machine, under oracles.

    `put_under` wraps a machine as one nested in `parent`.
    """
    for below, container in list(branching_below(parent.machine)):
        wrapper = wrapper_of(container)
        if wrapper is None and parent.in_force.nested:
            wrapper = _new_wrapper(parent, below, container)
        if wrapper is not None:
            _take_notice(wrapper, parent, below, put_under)


def release_branches(machine: object) -> None:
    """Give the Concurrences and Iterators below a machine back as they were before."""
    for _, container in list(branching_below(machine)):
        if wrapper_of(container) is not None:
            ask_no_more(container)
            for mark in (WRAPPER, HOOK):
                own_attributes(container).pop(mark, None)


def _new_wrapper(
    parent: TreeNode, below: Labels, container: smach.Container
) -> Optional[ContainerWrapper]:
    asks = asks_hook(type(container))
    try:
        if not asks:
            have_asked(container)
    except TypeError as err:
        smach.logwarn(
            '{}/{}: its states get no oracle, since its class cannot be extended ({})'.format(
                parent.path, '/'.join(below), err
            )
        )
        return None
    is_iterator = isinstance(container, smach.Iterator)
    kind = IteratorWrapper if is_iterator else ConcurrenceWrapper
    wrapper: ContainerWrapper = kind(container)
    own_attributes(container).update({WRAPPER: wrapper, **({HOOK: wrapper} if asks else {})})
    return wrapper


def _take_notice(
    wrapper: ContainerWrapper, parent: TreeNode, below: Labels, put_under: PutUnder
) -> None:
    """Have a machine for each branch that there is now."""
    if wrapper.top is None or wrapper.top.tree is not parent.tree:
        wrapper.top, wrapper.below = parent, below
    if wrapper.top is not parent:
        return  # it is in two places: the first one is used
    found: Dict[str, smach.StateMachine] = {}
    for label, state in _plain_states(wrapper):
        machine = wrapper.machines.get(label)
        if machine is None and parent.wraps(below + (label,)):
            machine = _new_machine(wrapper, label, state, parent, below, put_under)
        if machine is not None:
            found[label] = machine
            cast(BranchMachine, machine).take(state, wrapper.container.userdata, {})
    wrapper.machines = found


def _plain_states(wrapper: ContainerWrapper) -> Iterator[Tuple[str, smach.State]]:
    for label, state in wrapper.states():
        if label and not isinstance(state, smach.Container):
            yield label, state


def _new_machine(
    wrapper: ContainerWrapper,
    label: str,
    state: smach.State,
    parent: TreeNode,
    below: Labels,
    put_under: PutUnder,
) -> smach.StateMachine:
    container = wrapper.container
    is_iterator = isinstance(container, smach.Iterator)
    bare = BranchMachine(label, is_alone=is_iterator)
    bare.take(state, container.userdata, {})
    kind: Callable[[smach.Container, str], BranchSite] = (
        IteratorSite if is_iterator else ConcurrenceSite
    )
    machine = put_under(bare, parent)
    node = marked_node(machine)
    node.site = kind(container, label)
    node.lie_below(parent, below)
    node.configure(parent.settings)
    return machine
