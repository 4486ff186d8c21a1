"""Gives the plain states of the Concurrences and Iterators of a wrapped tree their machines."""

from typing import Callable, Dict, Iterator, Optional, Tuple, cast

import smach

from ..machine.nesting import borders_below
from ..machine.protocols import Labels
from ..machine.tree_node import TreeNode, WrappedMachine
from .border import Border, border_of
from .border_classes import put_border, take_border_away
from .branch import Branch, ConcurrenceBranch, IteratorBranch
from .branch_machine import BranchMachine

PutUnder = Callable[[smach.StateMachine, TreeNode], WrappedMachine]


def adopt_branches(parent: TreeNode, put_under: PutUnder) -> None:
    """Put the branches below a wrapped machine, down to the next machine, under oracles.

    `put_under` wraps a machine as one nested in `parent`.
    """
    for below, container in list(borders_below(parent.machine)):
        border = border_of(container)
        if border is None and parent.in_force.nested:
            border = _new_border(parent, below, container)
        if border is not None:
            _take_notice(border, parent, below, put_under)


def release_branches(machine: object) -> None:
    """Give the Concurrences and Iterators below a machine back as they were before."""
    for _, container in list(borders_below(machine)):
        take_border_away(container)


def _new_border(parent: TreeNode, below: Labels, container: smach.Container) -> Optional[Border]:
    try:
        put_border(container)
    except TypeError as err:
        smach.logwarn(
            '{}/{}: its states get no oracle, since its class cannot be extended ({})'.format(
                parent.path, '/'.join(below), err
            )
        )
    return border_of(container)


def _take_notice(border: Border, parent: TreeNode, below: Labels, put_under: PutUnder) -> None:
    """Have a machine for each branch that there is now."""
    if border.top is None or border.top.tree is not parent.tree:
        border.top, border.below = parent, below
    if border.top is not parent:
        return  # it is in two places: the first one is used
    found: Dict[str, WrappedMachine] = {}
    for label, state in _plain_states(border):
        machine = border.machines.get(label)
        if machine is None and parent.wraps(below + (label,)):
            machine = _new_machine(border, label, state, parent, below, put_under)
        if machine is not None:
            found[label] = machine
            cast(BranchMachine, machine).take(state, border.container.userdata, {})
    border.machines = found


def _plain_states(border: Border) -> Iterator[Tuple[str, smach.State]]:
    for label, state in border.states():
        if label and not isinstance(state, smach.Container):
            yield label, state


def _new_machine(
    border: Border,
    label: str,
    state: smach.State,
    parent: TreeNode,
    below: Labels,
    put_under: PutUnder,
) -> WrappedMachine:
    container = border.container
    is_iterator = isinstance(container, smach.Iterator)
    bare = BranchMachine(label, is_alone=is_iterator)
    bare.take(state, container.userdata, {})
    kind: Callable[[smach.Container, str], Branch] = (
        IteratorBranch if is_iterator else ConcurrenceBranch
    )
    machine = put_under(bare, parent)
    node = machine._oracle
    node.branch = kind(container, label)
    node.lie_below(parent, below)
    node.configure(parent.settings)
    return machine
