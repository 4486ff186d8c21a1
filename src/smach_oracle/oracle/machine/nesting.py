"""Which machines are nested in which, and which of them are under an oracle."""
from typing import Iterator, List, Mapping, Tuple, cast

import smach

from .protocols import Labels
from .tree_node import TreeNode, WrappedMachine


def machines_below(
    container: object, below: Labels = ()) -> Iterator[Tuple[Labels, smach.StateMachine]]:
    """Yield the state machines nested in a container, each with the labels that lead to it.

    It looks through Concurrences and Iterators, but not into the machines that it finds.
    """
    for label, state in list(_children(container).items()):
        path = below + (label,)
        if isinstance(state, smach.StateMachine):
            yield path, state
        elif isinstance(state, smach.Container):
            yield from machines_below(state, path)


def _children(container: object) -> Mapping[str, smach.State]:
    if isinstance(container, smach.StateMachine):
        return container._states
    return container.get_children() if isinstance(container, smach.Container) else {}


def containers_in(machine: WrappedMachine) -> List[WrappedMachine]:
    """Return a wrapped machine and all wrapped machines nested in it, each once."""
    wrapped = machine._oracle.tree.container_class
    found: List[WrappedMachine] = []
    waiting: List[WrappedMachine] = [machine]
    while waiting:
        container = waiting.pop(0)
        if not any(container is each for each in found):
            found.append(container)
            waiting.extend(cast(WrappedMachine, child) for _, child in machines_below(container)
                           if isinstance(child, wrapped))
    return found


def nodes_of(machine: WrappedMachine) -> Iterator[TreeNode]:
    """Yield the node of a container and those of all wrapped containers below it, each once."""
    for container in containers_in(machine):
        yield container._oracle
