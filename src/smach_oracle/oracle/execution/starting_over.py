"""Starts a script over: its userdata as it was at first, in all containers of the tree."""

from ..machine.nesting import nodes_of
from ..machine.snapshots import restore
from ..machine.tree_node import TreeNode


def may_start_over(node: TreeNode) -> bool:
    """Whether a policy of the tree may start its top machine over."""
    return node.tree.recover and any(
        each.in_force.policy.restarts for each in nodes_of(node.machine)
    )


def keep_start(node: TreeNode) -> None:
    """Keep the userdata of a machine and of those in it, before its first state.

    References are kept, and copies of `deep_copy_keys`, as in any snapshot. Branches of
    Concurrences and Iterators have no userdata of their own.
    """
    node.tree.restarts.keep(
        {id(each): each.snapshot() for each in nodes_of(node.machine) if each.branch is None}
    )


def restore_start(node: TreeNode) -> None:
    """Put the userdata of a machine, and of those in it, back to that of the start. Count it."""
    restarts = node.tree.restarts
    restarts.count += 1
    for each in nodes_of(node.machine):
        userdata = restarts.userdata_of(each)
        if userdata is not None:
            restore(each.machine.userdata._data, userdata, (), each.in_force.deep_copy_keys)
