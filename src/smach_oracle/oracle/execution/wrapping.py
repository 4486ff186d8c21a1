"""Whole trees: puts a machine, and the machines nested in it, under one oracle each."""

from typing import cast

import smach

from ..branches.adopting import adopt_branches
from ..errors import SettingsError
from ..identity import own_attributes
from ..machine.learned_rates import load_rates
from ..machine.nesting import containers_in, machines_below, nodes_of
from ..machine.tree import Tree
from ..machine.tree_node import TreeNode, WrappedMachine
from ..settings.patterns import Nested
from ..settings.settings import Settings
from ..settings.unfit_names import Strictness
from ..smach_private import Labels
from .item_gates import place_gates
from .settings_check import check_names, check_preconditions
from .unwrapping import strip_alone
from .wrapped_classes import change_class, two_classes


def wrap_machine(
    oracle_class: type,
    given: object,
    tree: Tree,
    settings: Settings,
    nested: Nested,
    name: str,
    strict: Strictness,
) -> WrappedMachine:
    """Wrap a machine and what is nested in it. See OracleContainer.wrap.

    A machine that is wrapped already keeps its tree, and takes over from `tree` what is new.

    :raises SettingsError: for what is no machine or cannot be wrapped, and for settings that do not
        fit it. A bare machine then stays bare.
    """
    if not isinstance(given, smach.StateMachine):
        raise SettingsError('machine', given, 'a smach.StateMachine')
    if isinstance(given, tree.container_class):
        return _wrap_again(cast(WrappedMachine, given), tree, settings, nested, name, strict)
    try:
        machine = _put_under(given, oracle_class, tree, settings, name)
        _put_in_order(machine, settings, nested, strict)
    except SettingsError:  # as if nobody had tried
        _unwrap(given, tree)
        raise
    return machine


def _put_under(
    machine: smach.StateMachine, oracle_class: type, tree: Tree, settings: Settings, name: str
) -> WrappedMachine:
    change_class(machine, oracle_class)
    wrapped = cast(WrappedMachine, machine)
    node = own_attributes(machine)['_oracle'] = TreeNode(wrapped, tree, settings, name)
    return node.machine


def _put_in_order(
    machine: WrappedMachine, settings: Settings, nested: Nested, strict: Strictness
) -> None:
    top = machine._oracle
    top.in_force.wrap_with(strict, nested)
    adopt(machine)
    _configure(machine, settings)
    for node in nodes_of(machine):
        node.in_force.wrap_with(strict)
    for node in nodes_of(machine):
        bring_up_to_date(node)


def bring_up_to_date(node: TreeNode) -> None:
    """Take notice of states added since.

    :raises SettingsError: where the settings do not fit them.
    """
    node.machine._sync_oracle()
    place_gates(node)
    states = len(node.machine._states)
    if node.in_force.is_unchecked(states):
        if node.parent is None:
            check_names(node)
        check_preconditions(node)
        node.in_force.note_checked(states)
    load_rates(node)


def _configure(machine: WrappedMachine, settings: Settings) -> None:
    """Hand the settings to a machine and to those below it that have none of their own."""
    for node in nodes_of(machine):
        if node.machine is machine or node.in_force.inherits:
            node.configure(settings)


def _wrap_again(
    machine: WrappedMachine,
    tree: Tree,
    settings: Settings,
    nested: Nested,
    name: str,
    strict: Strictness,
) -> WrappedMachine:
    top = machine._oracle
    before = top.settings
    try:
        for container in containers_in(machine):
            container._remove_oracle()
        top.tree.recover = tree.recover
        top.take_name(name)
        if tree.expert is not None:
            top.tree.expert = tree.expert
        if tree.health.given is not None:
            top.tree.health.given = tree.health.given
        _configure(machine, settings)
        _put_in_order(machine, settings, nested, strict)
    except SettingsError:
        _configure(machine, before)
        raise
    return machine


def _unwrap(machine: smach.StateMachine, tree: Tree) -> None:
    """Give a machine that could not be wrapped, and what was wrapped with it, back as it was."""
    if not isinstance(machine, tree.container_class):
        return
    for container in containers_in(cast(WrappedMachine, machine)):
        made_of = two_classes(type(container))
        if made_of is not None and (container is machine or container._oracle.in_force.inherits):
            strip_alone(container)


def adopt(machine: WrappedMachine) -> None:
    """Wrap what is nested in a wrapped machine and is not wrapped yet, into one tree with it.

    :raises SettingsError: for a machine whose class cannot be extended.
    """
    parent = machine._oracle
    adopt_branches(parent, _put_below)
    for below, child in machines_below(machine):
        if isinstance(child, parent.tree.container_class):
            container = cast(WrappedMachine, child)
        elif parent.wraps(below):
            container = _put_below(child, parent)
        else:
            continue
        node = container._oracle
        if container is not machine and (node.parent is None or node.tree is not parent.tree):
            _move_below(node, parent, below)
        node.in_force.wrap_with(nested=parent.in_force.nested)
        adopt(container)


def _put_below(child: smach.StateMachine, parent: TreeNode) -> WrappedMachine:
    container = _put_under(child, parent.tree.container_class, parent.tree, parent.settings, '')
    container._oracle.in_force.wrap_with(parent.in_force.strict, inherits=True)
    return container


def _move_below(node: TreeNode, parent: TreeNode, below: Labels) -> None:
    """Make a wrapped machine one below `parent`.

    It may have been on its own, or below another machine, before.
    """
    node.machine._remove_oracle()  # it may go by another name here, or not be wanted
    node.lie_below(parent, below)
    node.join(parent.tree)
    if node.in_force.inherits:
        node.in_force.wrap_with(parent.in_force.strict)
    node.configure(parent.settings if node.in_force.inherits else node.settings)
