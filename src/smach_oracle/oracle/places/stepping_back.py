"""Tells what the visits say about a failure, and what ran before it in the levels above."""

from ..decision.policy import FailureContext
from ..machine.tree_node import TreeNode
from ..records.state_record import StateRecord
from .levels import is_direct, levels_above


def failure_context(node: TreeNode, record: StateRecord) -> FailureContext:
    """Return what the visits so far say about a failure of a state of a container.

    With `step_back_across` its initial state is that before the container, in the levels above,
    where there is one.
    """
    context = node.records.failure_context(record, node.machine._initial_state_label or '')
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
