"""The rates file of a tree: written and read where the settings name one."""
from ..records.rates_file import read_rates, write_rates
from .nesting import nodes_of
from .tree_node import TreeNode


def save_rates(node: TreeNode) -> None:
    """Write the rates file of the top machine, if there is one.

    What goes wrong is logged and stops nothing.
    """
    top = node.top()
    path = top.settings.rates_file
    if not path:
        return
    try:
        with node.tree.rates_lock:
            write_rates(path, nodes_of(top.machine))
    except OSError as err:
        node.warn('rates file {} cannot be written: {}'.format(path, err))


def load_rates(node: TreeNode) -> None:
    """Read the rates file of the top machine, if it is another than the last one read."""
    path = node.settings.rates_file
    if node.parent is None and node.tree.rates_loaded != path:
        node.tree.rates_loaded = path
        read_rates(path, nodes_of(node.machine))
