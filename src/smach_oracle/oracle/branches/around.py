"""The wrappers of the Concurrences and Iterators around a container, and in its states."""

from typing import List, Tuple

import smach

from ..machine.nesting import branching_below
from ..machine.tree_node import TreeNode
from ..smach_private import states_of
from .iterator_wrapper import IteratorWrapper
from .wrapper import ContainerWrapper, wrapper_of


def wrappers_around(node: TreeNode) -> List[Tuple[str, ContainerWrapper]]:
    """Return them, each with its path, the outermost first."""
    parent = node.parent
    if parent is None or not node.runs_in_branch:
        return []
    found = []
    for below, container in branching_below(parent.machine):
        wrapper = wrapper_of(container)
        if wrapper is not None and node.below[: len(below)] == below:
            found.append(('/'.join((parent.key,) + below), wrapper))
    return found


def wrappers_in(node: TreeNode, label: str) -> List[Tuple[str, ContainerWrapper]]:
    """Return those in a state of a machine, down to the next machines, each with its path."""
    return [
        ('/'.join((node.key,) + below), wrapper)
        for below, wrapper in (
            (below, wrapper_of(container)) for below, container in branching_below(node.machine)
        )
        if wrapper is not None and below[0] == label
    ]


def ask_to_go_on(node: TreeNode, target: str) -> None:
    """Note that the oracle goes to a state: an Iterator that has failed or was left goes on there.

    Any other Iterator of the container begins again when it is entered.
    """
    for label, state in list(states_of(node.machine).items()):
        wrapper = wrapper_of(state) if isinstance(state, smach.Container) else None
        if isinstance(wrapper, IteratorWrapper):
            wrapper.ask_to_go_on(label == target and wrapper.has_stopped_early(node, label))
