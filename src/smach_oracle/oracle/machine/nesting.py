"""Finds the machines nested in others, and those of them that are under an oracle."""

from typing import Any, Iterator, List, Mapping, Tuple, cast

import smach

from ..identity import own_mark
from .protocols import Labels
from .tree_node import TreeNode, WrappedMachine

BORDER = '_oracle_border'  # the mark of a Concurrence or an Iterator of a wrapped tree


def machines_below(
    container: object, below: Labels = ()
) -> Iterator[Tuple[Labels, smach.StateMachine]]:
    """Yield the state machines nested in a container, each with the labels that lead to it.

    It looks through Concurrences and Iterators, but not into the machines that it finds. Of a
    plain state of those it yields the hidden machine, if it has one, with the labels of the
    Concurrence or Iterator.
    """
    border = own_mark(container, BORDER)
    if border is not None:
        yield from ((below, machine) for machine in list(border.machines.values()))
    for label, state in list(children_of(container).items()):
        path = below + (label,)
        if isinstance(state, smach.StateMachine):
            yield path, state
        elif isinstance(state, smach.Container):
            yield from machines_below(state, path)


def borders_below(
    container: object, below: Labels = ()
) -> Iterator[Tuple[Labels, smach.Container]]:
    """Yield the Concurrences and Iterators in a container, each with the labels that lead to it.

    It looks through them, but not into machines.
    """
    for label, state in list(children_of(container).items()):
        path = below + (label,)
        if isinstance(state, smach.Container) and not isinstance(state, smach.StateMachine):
            if isinstance(state, (smach.Concurrence, smach.Iterator)):
                yield path, state
            yield from borders_below(state, path)


def children_of(container: object) -> Mapping[str, smach.State]:
    """Return the states of a container by label, none of what is no container."""
    if isinstance(container, smach.StateMachine):
        return container._states
    return container.get_children() if isinstance(container, smach.Container) else {}


def paths_below(container: object, above: Labels = ()) -> Iterator[str]:
    """Yield the paths of what may have an oracle of its own, at any depth.

    These are the machines in a container, and the plain states of its Concurrences and Iterators.
    """
    for label, state in list(children_of(container).items()):
        path = above + (label,)
        is_branch = (
            not isinstance(container, smach.StateMachine)
            and isinstance(state, smach.State)
            and not isinstance(state, smach.Container)
        )
        if is_branch or isinstance(state, smach.StateMachine):
            yield '/'.join(map(str, path))
        yield from paths_below(state, path)


def items_under_way(node: TreeNode) -> str:
    """Say which items of the Iterators around a container are under way, the innermost first."""
    found: List[str] = []
    while node.parent is not None:
        state: Any = node.parent.machine._states.get(node.below[0])
        around: List[str] = []
        for label in node.below[1:] + ('',):
            border = own_mark(state, BORDER)
            words = border.in_words() if border is not None else ''
            if words:
                around.append(words)
            state = border.container.get_children().get(label) if border is not None else None
        found += reversed(around)
        node = node.parent
    return ' of '.join(found)


def containers_in(machine: WrappedMachine) -> List[WrappedMachine]:
    """Return a wrapped machine and all wrapped machines nested in it, each once."""
    wrapped = machine._oracle.tree.container_class
    found: List[WrappedMachine] = []
    waiting: List[WrappedMachine] = [machine]
    while waiting:
        container = waiting.pop(0)
        if not any(container is each for each in found):
            found.append(container)
            waiting.extend(
                cast(WrappedMachine, child)
                for _, child in machines_below(container)
                if isinstance(child, wrapped)
            )
    return found


def nodes_of(machine: WrappedMachine) -> Iterator[TreeNode]:
    """Yield the node of a container and those of all wrapped containers below it, each once."""
    for container in containers_in(machine):
        yield container._oracle
