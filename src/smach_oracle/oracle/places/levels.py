"""The levels of a tree: the wrapped containers that are being executed around one another.

The first level of a failure is its own container, then comes the one above it, and so on to the
top.
"""

from typing import Iterator

from ..decision.policy import FailureContext
from ..machine.nesting import nodes_of
from ..machine.tree_node import TreeNode
from ..records.state_record import StateRecord
from ..smach_private import current_state_of, initial_label_of, is_executing, states_of


def levels_above(node: TreeNode) -> Iterator[TreeNode]:
    """Yield the wrapped containers that are being executed around this one, innermost first."""
    child, above = node, node.parent
    while above is not None and _executes(above, child):
        yield above
        child, above = above, above.parent


def _executes(above: TreeNode, child: TreeNode) -> bool:
    """Whether a container is now in the state that holds the one below it."""
    machine = above.machine
    state = states_of(machine).get(child.below[0])
    return is_executing(machine) and state is not None and current_state_of(machine) is state


def is_direct(node: TreeNode) -> bool:
    """Whether nothing lies between a container and the wrapped one above it."""
    return node.parent is not None and not node.runs_in_branch


def nodes_of_tree(node: TreeNode) -> Iterator[TreeNode]:
    """Yield the container itself, the levels above it, and then the others of the tree."""
    first = [node, *levels_above(node)]
    yield from first
    for each in nodes_of(first[-1].machine):
        if not any(each is one for one in first):
            yield each


def failure_context(node: TreeNode, record: StateRecord) -> FailureContext:
    """Return what the visits so far say about a failure of a state of a container.

    With `step_back_across` its initial state is that before the container, in the levels above,
    where there is one.
    """
    context = node.records.failure_context(record, initial_label_of(node.machine))
    before = _state_before(node) if node.settings.step_back_across else ''
    return context._replace(initial=before) if before else context


def _state_before(node: TreeNode) -> str:
    """Return the path of the state to which the policies above would step back from a container.

    It is '' where none has run before, or where a Concurrence or an Iterator lies between.
    """
    child = node
    for above in levels_above(node):
        if not is_direct(child):
            break
        context = above.records.failure_context(above.record(child.below[0]), '')
        name = above.in_force.policy.step_back_target(context)
        if name:
            return name if '/' in name else '{}/{}'.format(above.relative_path, name)
        child = above
    return ''
