"""Puts a machine, and those nested in it, under one oracle each, and takes them out again."""

from typing import Any, Dict, List, NamedTuple, Optional

import smach

from ..asking.question import names
from ..branches.adopting import adopt_branches, release_branches
from ..errors import LabelError, SettingsError, TrialError
from ..identity import set_class
from ..machine.nesting import holds_containers, machines_below, nodes_of, why_no_oracle
from ..machine.oracle import load_rates
from ..machine.tree import Tree
from ..machine.tree_node import TreeNode, marked_node, node_of
from ..machine.wrapped_classes import change_class, two_classes
from ..recovery.phases import OracleState
from ..settings.names import Nested, Strictness
from ..settings.settings import Settings
from ..smach_private import Labels, remappings_of, remove_mark, set_mark, states_of, transitions_of
from .boundary import place_gates, remove_gates
from .settings_check import check_names, check_preconditions


class WrapArguments(NamedTuple):
    """The arguments of a wrap that hold for the machine and for what it finds in it."""

    settings: Settings
    nested: Nested
    name: str
    strict: Strictness


def wrap_machine(
    oracle_class: type, given: object, tree: Tree, arguments: WrapArguments
) -> smach.StateMachine:
    """Wrap a machine and what is nested in it. See OracleContainer.wrap.

    A machine that is wrapped already keeps its tree, and takes over from `tree` what is new.

    :raises SettingsError: for what is no machine or cannot be wrapped, and for settings that do not
        fit it. A bare machine then stays bare.
    :raises LabelError: for a label that is not text. Likewise.
    """
    if not isinstance(given, smach.StateMachine):
        raise SettingsError('machine', given, 'a smach.StateMachine')
    _check_labels(given, arguments.name or type(given).__name__)
    if isinstance(given, tree.container_class):
        return _wrap_again(given, tree, arguments)
    try:
        settings, name = arguments.settings, arguments.name
        machine = _put_under(given, oracle_class, tree, settings, name).machine
        _put_in_order(machine, arguments)
    except SettingsError:  # as if nobody had tried
        if isinstance(given, tree.container_class):
            _strip(given)
        raise
    return machine


def _put_under(
    machine: smach.StateMachine, oracle_class: type, tree: Tree, settings: Settings, name: str
) -> TreeNode:
    change_class(machine, oracle_class)
    node = TreeNode(machine, tree, settings, name)
    set_mark(machine, node)
    return node


def _put_in_order(machine: smach.StateMachine, arguments: WrapArguments) -> None:
    top = marked_node(machine)
    top.in_force.strict, top.in_force.nested = arguments.strict, arguments.nested
    adopt(machine)
    for node in nodes_of(machine):
        node.in_force.strict = arguments.strict
    for node in nodes_of(machine):
        bring_up_to_date(node)
    load_rates(top)


def bring_up_to_date(node: TreeNode) -> None:
    """Take notice of states added since.

    :raises SettingsError: where the settings do not fit them.
    :raises LabelError: for a label that is not text.
    """
    if node.in_force.checked_states != len(states_of(node.machine)):
        _check_labels(node.machine, node.path)
        sync_oracle(node)
        if node.parent is None:
            check_names(node)
        check_preconditions(node)
        node.in_force.checked_states = len(states_of(node.machine))


def _check_labels(machine: smach.StateMachine, name: str) -> None:
    why_not = why_no_oracle(machine)
    if why_not:
        raise LabelError('{}: {}'.format(name, why_not))


def _configure(machine: smach.StateMachine, settings: Settings) -> None:
    """Hand the settings to a machine and to those below it that have none of their own."""
    for node in nodes_of(machine):
        if node.machine is machine or node.in_force.inherits:
            node.configure(settings)


def _wrap_again(
    machine: smach.StateMachine, tree: Tree, arguments: WrapArguments
) -> smach.StateMachine:
    top = marked_node(machine)
    before = top.settings
    try:
        for node in nodes_of(machine):
            remove_oracle(node)
        top.tree.recover = tree.recover
        top.take_name(arguments.name)
        tree.take_over(top.tree)  # what is not given again stays
        top.tree.expert, top.tree.health.given = tree.expert, tree.health.given
        _configure(machine, arguments.settings)
        _put_in_order(machine, arguments)
    except SettingsError:
        _configure(machine, before)
        raise
    return machine


def adopt(machine: smach.StateMachine) -> List[TreeNode]:
    """Wrap what is nested in a wrapped machine and is not wrapped yet, into one tree with it.

    It returns the node of each container of the tree once. Each trial begins with this.

    :raises SettingsError: for a machine whose class cannot be extended.
    """
    found: Dict[int, TreeNode] = {}
    _adopt_below(marked_node(machine), found)
    return list(found.values())


def _adopt_below(parent: TreeNode, found: Dict[int, TreeNode]) -> None:
    found[id(parent)] = parent
    if not holds_containers(parent.machine):
        return
    place_gates(parent, adopt_branches(parent))
    for below, child in machines_below(parent.machine):
        node = node_of(child)
        if node is None:
            if not parent.wraps(below):
                continue
            why_not = why_no_oracle(child)
            if why_not:
                path = '/'.join((parent.path, *below))
                parent.tree.warn_for_good(
                    '{}: it has no oracle of its own, since {}'.format(path, why_not)
                )
                continue
            tree = parent.tree
            node = _put_under(child, tree.container_class, tree, parent.settings, '')
            node.in_force.inherit(parent.in_force)
        if node.parent is None or node.tree is not parent.tree:
            _move_below(node, parent, below)
        node.in_force.nested = parent.in_force.nested
        if id(node) not in found:
            _adopt_below(node, found)


def _move_below(node: TreeNode, parent: TreeNode, below: Labels) -> None:
    """Make a wrapped machine one below `parent`.

    It may have been on its own, or below another machine, before.
    """
    remove_oracle(node)  # it may go by another name here, or not be wanted
    if node.parent is None:
        parent.tree.take_over(node.tree)
    node.lie_below(parent, below)
    node.join(parent.tree)
    if node.in_force.inherits:
        node.in_force.strict = parent.in_force.strict
    node.configure(parent.settings if node.in_force.inherits else node.settings)


# -- the meta state


def sync_oracle(node: TreeNode) -> None:
    """Have an ORACLE state that leads to the states and outcomes there are now.

    :raises SettingsError: where its name is another's.
    """
    machine = node.machine
    states, transitions = states_of(machine), transitions_of(machine)
    if not node.tree.recover or not states:
        return
    label = node.in_force.of_machine.oracle_label
    meta = states.get(label)
    outcomes = machine.get_registered_outcomes()
    if isinstance(meta, OracleState) and meta.leads_on(
        tuple(states), outcomes, transitions.get(label, {})
    ):
        return
    if (meta is not None and not isinstance(meta, OracleState)) or label in outcomes:
        raise SettingsError(
            'oracle_label',
            label,
            'a name that is no state or outcome of {}, which has {}'.format(
                node.path, names(set(states).union(outcomes))
            ),
        )
    if meta is None:
        meta = OracleState()
        remappings_of(machine)[label] = {}
    if set(transitions.get(label, ())) != set(states).union(outcomes).difference((label,)):
        transitions[label] = meta.lead_to(
            tuple(node.labels())
            + tuple(name for name in sorted(outcomes, key=str) if name not in states)
        )
    states[label] = meta
    meta.note_led(tuple(states), outcomes, transitions[label])


def remove_oracle(node: TreeNode) -> None:
    """Take the ORACLE state out."""
    machine, label = node.machine, node.settings.oracle_label
    if isinstance(states_of(machine).get(label), OracleState):
        tables: List[Any] = [states_of(machine), transitions_of(machine), remappings_of(machine)]
        for table in tables:
            table.pop(label, None)


# -- unwrapping


def unwrap(machine: smach.StateMachine) -> smach.StateMachine:
    """Undo `OracleContainer.wrap` of a machine and of those wrapped with it.

    It stays the same object. Its learned rates are lost. A nested machine that was wrapped
    separately stays wrapped.

    >>> import smach
    >>> from smach_oracle.oracle import OracleContainer, unwrap
    >>> sm = smach.StateMachine(['succeeded', 'aborted'])
    >>> with sm:
    ...     _ = smach.StateMachine.add(
    ...         'PICK', smach.CBState(lambda userdata: 'aborted', outcomes=['succeeded', 'aborted'])
    ...     )
    >>> unwrap(OracleContainer.wrap(sm)) is sm
    True
    >>> sm.execute()  # nothing recovers from the failure
    'aborted'

    :raises TrialError: for a machine that was not wrapped, that runs, or that was wrapped together
        with a machine around it.
    """
    node = node_of(machine)
    if node is None or two_classes(type(machine)) is None:
        raise TrialError('{!r} was not wrapped: there is nothing to undo'.format(machine))
    if machine.is_running():
        raise TrialError('{} runs; it can be unwrapped when it has ended'.format(node.path))
    if node.in_force.inherits:
        raise TrialError('{} was wrapped with {}; unwrap that'.format(node.path, node.top().path))
    _strip(machine)
    return machine


def _strip(machine: smach.StateMachine) -> None:
    for _, child in list(machines_below(machine)):
        node = node_of(child)
        if node is None:
            continue
        if node.in_force.inherits:
            _strip(node.machine)
        else:
            _stand_alone(node.machine)
    strip_alone(machine)


def strip_alone(machine: smach.StateMachine) -> None:
    """Give a machine back as it was before it was wrapped, but not those that are nested in it."""
    release_branches(machine)
    remove_oracle(marked_node(machine))
    remove_gates(machine)
    made_of = two_classes(type(machine))
    if made_of is not None:
        set_class(machine, made_of[1])
        remove_mark(machine)


def _stand_alone(machine: smach.StateMachine) -> None:
    """Make a machine the top of a tree of its own, as before the machine around it was wrapped."""
    node = marked_node(machine)
    tree = Tree(node.tree.container_class, node.tree.recover, node.tree.expert)
    for each in nodes_of(machine):
        each.join(tree)
    node.lie_below(None, ())


def execute_bare(machine: smach.StateMachine, *args: object, **kwargs: object) -> Optional[str]:
    """Execute a machine in a child process of its program, as its author wrote it.

    All that is kept of the machine belongs to the program, and its threads are not in the child.
    """
    smach.logwarn(
        '{}: runs in a child process of the program, and without an oracle there'.format(
            marked_node(machine).path
        )
    )
    _make_bare(machine)
    outcome: Optional[str] = machine.execute(*args, **kwargs)
    return outcome


def _make_bare(machine: smach.StateMachine) -> None:
    """Take a machine, and those nested in it, out of the oracle.

    One that was built as an OracleContainer gets an oracle that only observes.
    """
    tree, name = marked_node(machine).tree, marked_node(machine).name
    for _, child in list(machines_below(machine)):
        if node_of(child) is not None:
            _make_bare(child)
    strip_alone(machine)
    if isinstance(machine, tree.container_class):
        observing = Tree(tree.container_class, recover=False)
        set_mark(machine, TreeNode(machine, observing, Settings(), name))
