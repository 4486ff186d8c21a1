"""The rates file of a tree: written and read where the settings name one."""

from ..records.name_claims import claim
from ..records.rates_file import read_rates, share_rates, write_rates
from .nesting import nodes_of
from .tree_node import TreeNode


def save_rates(node: TreeNode) -> None:
    """Add what was learned to the rates file of the top machine, if there is one.

    What goes wrong is logged and stops nothing.
    """
    top = node.top()
    path = top.settings.rates_file
    if not path:
        return
    claim(path, _name(top), top.tree)
    try:
        with node.tree.rates_lock:
            share_rates(path, _name(top), nodes_of(top.machine))
    except OSError as err:
        node.warn_once(path, 'rates file {} cannot be written: {}'.format(path, err))


def load_rates(node: TreeNode) -> None:
    """Read the rates file of the top machine, if it is another than the last one read."""
    path = node.settings.rates_file
    if node.parent is None and node.tree.rates_loaded != path:
        node.tree.rates_loaded = path
        if path:
            claim(path, _name(node), node.tree)
        read_rates(path, _name(node), nodes_of(node.machine), is_shared=True)


def write_by_hand(node: TreeNode, path: str) -> None:
    """Write what a machine has learned to a file.

    :raises OSError: where it cannot be written.
    """
    claim(path, _name(node.top()), node.tree)
    write_rates(path, _name(node.top()), nodes_of(node.machine))


def read_by_hand(node: TreeNode, path: str) -> None:
    """Take over what a file has of a machine."""
    read_rates(path, _name(node.top()), nodes_of(node.machine), is_shared=False)


def _name(top: TreeNode) -> str:
    return top.name if top.is_named else ''
