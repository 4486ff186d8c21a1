"""Prepares a place before a machine goes there, whoever sends it.

An Iterator that has failed or was left goes on there with the item that was not finished. A script
that is started over has its userdata as it was at first, in all containers of the tree.
"""

from typing import Collection, Iterable, NamedTuple, Tuple

from ..branches.around import ask_to_go_on
from ..checkpoint.resuming import forget_resumed
from ..machine.jump_path import JumpPath, missing_on
from ..machine.nesting import nodes_of
from ..machine.repeats import leave_for
from ..machine.snapshots import restore
from ..machine.tree import Tree
from ..machine.tree_node import TreeNode
from ..smach_private import data_of, remapping_of


class JumpEntry(NamedTuple):
    """The way in which a place is entered."""

    missing: Tuple[str, ...]  # input keys that it does not find
    userdata: str  # 'restore' or 'keep'


def prepare_entry(way: JumpPath, written: Collection[str], sent: str) -> JumpEntry:
    """Put the userdata back where the settings say so, and note in which states containers begin.

    To be called in the thread of the container that holds the whole way, its lock held.

    :param written: its userdata keys that survive a restore.
    :param sent: what is done, for a warning.
    """
    node, target = way.meets, way.first
    forget_resumed(node)
    missing = missing_for(way, written)
    snapshot = node.record(target).snapshot if node.settings.userdata == 'restore' else None
    if snapshot is not None:
        restore(data_of(node.machine.userdata), snapshot, written, node.in_force.deep_copy_keys)
    leave_for(node, target, way.down[1:])
    for place in way.down:
        ask_to_go_on(place.node, place.label)
    if missing:
        place = way.down[-1]
        place.node.warn(
            '{} there without its input keys {}'.format(sent, ', '.join(missing)), place.label
        )
    node.record(target).go_down(way.down[1:])
    return JumpEntry(missing, 'keep' if snapshot is None else 'restore')


def missing_for(way: JumpPath, written: Collection[str]) -> Tuple[str, ...]:
    """Return the input keys that a place would not find.

    :param written: keys of the container that holds the whole way, written for it.
    """
    missing = missing_on(way, written)
    node, label = way.down[-1]
    if not missing or node is not way.meets:  # keys of its own may have the same names
        return missing
    remapping = remapping_of(node.machine, label)
    return tuple(key for key in missing if remapping.get(key, key) not in written)


# -- a script that is started over


def may_start_over(tree: Tree, nodes: Iterable[TreeNode]) -> bool:
    """Whether a policy of the tree may start its top machine over."""
    return tree.recover and any(each.in_force.policy.restarts for each in nodes)


def keep_start(node: TreeNode) -> None:
    """Keep the userdata of a machine and of those in it, before its first state.

    References are kept, and copies of `deep_copy_keys`, as in any snapshot. Branches of
    Concurrences and Iterators have no userdata of their own.
    """
    node.tree.restarts.keep(
        {id(each): each.snapshot() for each in nodes_of(node.machine) if each.site.is_container}
    )


def start_over(node: TreeNode, target: str) -> None:
    """Put the userdata of a machine, and of those in it, back to that of the start. Count it."""
    restarts = node.tree.restarts
    restarts.count += 1
    for each in nodes_of(node.machine):
        userdata = restarts.userdata_of(each)
        if userdata is not None:
            restore(data_of(each.machine.userdata), userdata, (), each.in_force.deep_copy_keys)
    leave_for(node, target)
    ask_to_go_on(node, target)
