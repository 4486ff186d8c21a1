"""Logs the items of an Iterator that its author passes over when they fail."""

from ..machine.tree_node import TreeNode
from ..recovery.failure import Failure


def tell_passed_over(node: TreeNode, failure: Failure) -> None:
    """Say which item is passed over, where the author's loop outcomes have this failing outcome."""
    branch = node.branch
    item = branch.passes_over(failure.outcome) if branch is not None else ''
    if item:
        node.warn(
            '{} is passed over with {}, as its author has drawn it'.format(item, failure.outcome),
            failure.state,
        )
