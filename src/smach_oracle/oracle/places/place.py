"""Places: the states of all containers of a tree."""

from typing import Iterator, NamedTuple, Optional

from ..machine.nesting import nodes_of
from ..machine.tree_node import TreeNode
from .levels import nodes_of_tree


class TreePlace(NamedTuple):
    """One state of one container."""

    node: TreeNode
    label: str

    @property
    def path(self) -> str:
        """Return the path of the container, and the label."""
        return '{}/{}'.format(self.node.path, self.label)


def places_of(node: TreeNode) -> Iterator[TreePlace]:
    """Yield the places of the tree. Those of the container itself come first."""
    for each in nodes_of_tree(node):
        for label in each.labels():
            yield TreePlace(each, label)


def place_at(node: TreeNode, container: str, label: str) -> Optional[TreePlace]:
    """Return the place of a state in the tree, None where there is none.

    :param container: path of its container, '' for the container itself.
    """
    for each in nodes_of_tree(node):
        if each.path == (container or node.path) and each.has(label):
            return TreePlace(each, label)
    return None


def place_named(node: TreeNode, name: str, at_rest: bool = False) -> Optional[TreePlace]:
    """Return the place that a setting names, None where there is none.

    :param name: a label of the container itself, or the path of a state below the top machine,
        which may begin with '/'.
    :param at_rest: whether the whole tree is looked through, and not what is being executed.
    """
    if node.has(name):
        return TreePlace(node, name)
    path = name[1:] if name.startswith('/') else name
    for each in nodes_of(node.top().machine) if at_rest else nodes_of_tree(node):
        above = each.relative_path + '/' if each.relative_path else ''
        if path.startswith(above) and each.has(path[len(above) :]):
            return TreePlace(each, path[len(above) :])
    return None
