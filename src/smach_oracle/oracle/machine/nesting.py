"""Finds the machines nested in others, and those of them that are under an oracle."""

from collections import deque
from typing import Dict, Iterator, List, Mapping, Optional, Protocol, Tuple, cast

import smach

from ..identity import own_mark
from ..smach_private import Labels, states_of
from .state_record import StateRecord
from .tree_node import TreeNode, marked_node, node_of

WRAPPER = '_oracle_wrapper'  # the mark of a Concurrence or an Iterator of a wrapped tree


class Wrapper(Protocol):
    """The data kept for a Concurrence or an Iterator (`branches.wrapper`)."""

    container: smach.Container
    branches: Dict[str, smach.StateMachine]  # each stands for one

    def in_words(self) -> str:
        """Return which item is under way, such as 'item 2 of 4', or '' where none is."""


def wrapper_of(state: object) -> Optional[Wrapper]:
    """Return the wrapper of a Concurrence or an Iterator, None for anything else.

    A shallow copy has the mark of another one.
    """
    mark = own_mark(state, WRAPPER)
    return cast('Wrapper', mark) if own_mark(mark, 'container') is state else None


def machines_below(
    container: object, below: Labels = ()
) -> Iterator[Tuple[Labels, smach.StateMachine]]:
    """Yield the state machines nested in a container, each with the labels that lead to it.

    It looks through Concurrences and Iterators, but not into the machines that it finds. It yields
    the branches of those, too, with the labels of the Concurrence or Iterator.
    """
    # a machine has none, and is what is asked most often
    wrapper = None if isinstance(container, smach.StateMachine) else wrapper_of(container)
    if wrapper is not None:
        yield from ((below, each) for each in [*wrapper.branches.values()])
    for label, state in containers_of(container):
        if isinstance(state, smach.StateMachine):
            yield below + (label,), state
        else:
            yield from machines_below(state, below + (label,))


def nodes_in(state: smach.State) -> List[TreeNode]:
    """Return the outermost wrapped machines of a state, which may be one itself."""
    if not isinstance(state, smach.Container):  # as most states: each failure asks
        return []
    if isinstance(state, smach.StateMachine):
        machines = [state]
    else:
        machines = [machine for _, machine in machines_below(state)]
    return [node for node in map(node_of, machines) if node is not None]


def gave_up_in(state: smach.State) -> bool:
    """Whether the oracle of a container in a state, or of the state itself, has given up."""
    return any(node.execution.unrecovered for node in nodes_in(state))


def branching_below(
    container: object, below: Labels = ()
) -> Iterator[Tuple[Labels, smach.Container]]:
    """Yield the Concurrences and Iterators in a container, each with the labels that lead to it.

    It looks through them, but not into machines.
    """
    for label, state in containers_of(container):
        if not isinstance(state, smach.StateMachine):
            path = below + (label,)
            if isinstance(state, (smach.Concurrence, smach.Iterator)):
                yield path, state
            yield from branching_below(state, path)


def children_of(container: object) -> Mapping[str, smach.State]:
    """Return the states of a container by label, none of what is no container."""
    if isinstance(container, smach.StateMachine):
        return states_of(container)
    return container.get_children() if isinstance(container, smach.Container) else {}


def containers_of(container: object) -> List[Tuple[str, smach.Container]]:
    """Return those of its states that are containers, by label, where that is text.

    Another thread may add states meanwhile. A copy is one step to it. A list of pairs is not: each
    pair is a new object, for which Python may collect garbage, and that runs code.
    """
    return [
        (label, state)
        for label, state in dict(children_of(container)).items()
        if isinstance(state, smach.Container) and isinstance(label, str)
    ]


def why_no_oracle(container: smach.Container) -> str:
    """Say which label of a container's states is not text, '' where all are."""
    for label, state in dict(children_of(container)).items():
        if not isinstance(label, str) and state is not None:
            return 'the label {!r} of a state is not text; allowed: text, such as {!r}'.format(
                label, str(label)
            )
    return ''


def holds_containers(machine: smach.StateMachine) -> bool:
    """Whether one of its states is a container. Most machines have none."""
    for state in list(states_of(machine).values()):  # a plain loop: each trial asks it of all
        if isinstance(state, smach.Container):
            return True
    return False


def paths_below(container: object, above: Labels = ()) -> Iterator[str]:
    """Yield the paths of what may have an oracle of its own, at any depth.

    These are the machines in a container, and the plain states of its Concurrences and Iterators.
    """
    for label, state in dict(children_of(container)).items():
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
        state: object = states_of(node.parent.machine).get(node.labels_from_parent[0])
        around: List[str] = []
        for label in node.labels_from_parent[1:] + ('',):
            wrapper = wrapper_of(state)
            words = wrapper.in_words() if wrapper is not None else ''
            if words:
                around.append(words)
            state = wrapper.container.get_children().get(label) if wrapper is not None else None
        found += reversed(around)
        node = node.parent
    return ' of '.join(found)


def nodes_of(machine: smach.StateMachine) -> List[TreeNode]:
    """Return the node of a container and those of all wrapped containers below it, each once."""
    found = {id(machine): marked_node(machine)}
    waiting = deque([machine])
    while waiting:
        for _, child in machines_below(waiting.popleft()):
            node = node_of(child)
            if id(child) not in found and node is not None:
                found[id(child)] = node
                waiting.append(child)
    return list(found.values())


def records_of(node: TreeNode) -> Iterator[StateRecord]:
    """Yield the records of all states of the tree in which a container lies."""
    for each in nodes_of(node.top().machine):
        yield from list(each.records.by_label.values())


def settle_ways(node: TreeNode, helped: Optional[bool]) -> None:
    """Note the result of all ways that are gone in a tree. None: nobody knows it."""
    for record in records_of(node):
        record.settle_way(helped)
