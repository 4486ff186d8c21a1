"""Takes a machine out of its oracle again: the opposite of wrapping."""

from typing import Optional, cast

import smach

from ..branches.adopting import release_branches
from ..errors import TrialError
from ..identity import own_attributes, set_class
from ..machine.nesting import machines_below, nodes_of
from ..machine.tree import Tree
from ..machine.tree_node import TreeNode, WrappedMachine, node_of
from ..settings.settings import Settings
from .item_gates import remove_gates
from .wrapped_classes import two_classes


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
    _strip(cast(WrappedMachine, machine))
    return machine


def _strip(machine: WrappedMachine) -> None:
    container_class = machine._oracle.tree.container_class
    for _, child in list(machines_below(machine)):
        if not isinstance(child, container_class):
            continue
        wrapped = cast(WrappedMachine, child)
        if wrapped._oracle.in_force.inherits:
            _strip(wrapped)
        else:
            _stand_alone(wrapped)
    strip_alone(machine)


def strip_alone(machine: WrappedMachine) -> None:
    """Give a machine back as it was before it was wrapped, but not those that are nested in it."""
    release_branches(machine)
    machine._remove_oracle()
    remove_gates(cast(smach.StateMachine, machine))
    made_of = two_classes(type(machine))
    if made_of is not None:
        set_class(machine, made_of[1])
        del own_attributes(machine)['_oracle']


def _stand_alone(machine: WrappedMachine) -> None:
    """Make a machine the top of a tree of its own, as before the machine around it was wrapped."""
    node = machine._oracle
    tree = Tree(node.tree.container_class, node.tree.recover, node.tree.expert)
    for each in nodes_of(machine):
        each.join(tree)
    node.lie_below(None, ())


def execute_bare(machine: smach.StateMachine, *args: object, **kwargs: object) -> Optional[str]:
    """Execute a machine in a child process of its program, as its author wrote it.

    All that is kept of the machine belongs to the program, and its threads are not in the child.
    """
    wrapped = cast(WrappedMachine, machine)
    smach.logwarn(
        '{}: runs in a child process of the program, and without an oracle there'.format(
            wrapped._oracle.path
        )
    )
    _make_bare(wrapped)
    outcome: Optional[str] = machine.execute(*args, **kwargs)
    return outcome


def _make_bare(machine: WrappedMachine) -> None:
    """Take a machine, and those nested in it, out of the oracle.

    One that was built as an OracleContainer gets an oracle that only observes.
    """
    tree, name = machine._oracle.tree, machine._oracle.name
    for _, child in list(machines_below(machine)):
        if isinstance(child, tree.container_class):
            _make_bare(cast(WrappedMachine, child))
    strip_alone(machine)
    if isinstance(machine, tree.container_class):
        machine._oracle = TreeNode(
            machine, Tree(tree.container_class, recover=False), Settings(), name
        )
