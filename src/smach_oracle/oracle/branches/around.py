"""Finds the Concurrences and Iterators between a container and the machine above it."""

from typing import List, Tuple

from ..machine.nesting import borders_below
from ..machine.tree_node import TreeNode
from .border import Border, border_of


def borders_around(node: TreeNode) -> List[Tuple[str, Border]]:
    """Return them, each with its path, the outermost first."""
    parent = node.parent
    if parent is None or (len(node.below) < 2 and node.branch is None):
        return []
    found = []
    for below, container in borders_below(parent.machine):
        border = border_of(container)
        if border is not None and node.below[: len(below)] == below:
            found.append(('/'.join((parent.key,) + below), border))
    return found


def borders_in(node: TreeNode, label: str) -> List[Tuple[str, Border]]:
    """Return those in a state of a machine, down to the next machines, each with its path."""
    return [
        ('/'.join((node.key,) + below), border)
        for below, border in (
            (below, border_of(container)) for below, container in borders_below(node.machine)
        )
        if border is not None and below[0] == label
    ]
