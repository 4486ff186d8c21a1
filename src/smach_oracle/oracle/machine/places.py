"""Places: the states of all containers of a tree, the levels around them, the links between them.

The *levels* of a failure are the wrapped containers that are being executed around it: its own, the
one above it, and so on to the top.
"""

from typing import Iterator, List, Mapping, NamedTuple, Optional, cast

import smach

from ..decision.policy import FailureContext
from ..settings.names import did_you_mean
from ..smach_private import (
    current_state_of,
    initial_label_of,
    is_executing,
    remapping_in,
    states_of,
)
from .nesting import nodes_of
from .state_record import StateRecord
from .tree_node import TreeNode


class ContainerLink(NamedTuple):
    """A container in the container around it, which may be a Concurrence or an Iterator."""

    outer_container: smach.Container
    label: str
    inner_container: smach.Container

    @property
    def remapping(self) -> Mapping[str, str]:
        """Key of the outer container by key of the inner one, where they differ."""
        return remapping_in(self.outer_container, self.label)


def links_to(node: TreeNode) -> Iterator[ContainerLink]:
    """Yield the links from the wrapped container above one to it, from above to below.

    The top machine has none.
    """
    outer: smach.Container = (node.parent or node).machine
    for label in node.labels_from_parent:
        inner = cast(smach.Container, child_of(outer, label))
        yield ContainerLink(outer, label, inner)
        outer = inner


def child_of(container: smach.Container, label: str) -> smach.State:
    """Return a state of a container of whatever kind."""
    if isinstance(container, smach.StateMachine):
        return states_of(container)[label]
    return container.get_children()[label]


# -- levels


def levels_above(node: TreeNode) -> Iterator[TreeNode]:
    """Yield the wrapped containers that are being executed around this one, innermost first."""
    child, above = node, node.parent
    while above is not None and _executes(above, child):
        yield above
        child, above = above, above.parent


def _executes(above: TreeNode, child: TreeNode) -> bool:
    """Whether a container is now in the state that holds the one below it."""
    machine = above.machine
    state = states_of(machine).get(child.labels_from_parent[0])
    return is_executing(machine) and state is not None and current_state_of(machine) is state


def is_direct(node: TreeNode) -> bool:
    """Whether nothing lies between a container and the wrapped one above it."""
    return node.parent is not None and not node.runs_in_branch


def nodes_of_tree(node: TreeNode) -> Iterator[TreeNode]:
    """Yield the container itself, the levels above it, and then the others of the tree."""
    first = [node, *levels_above(node)]
    yield from first
    for each in nodes_of(first[-1].machine):
        if not any(each is one for one in first):
            yield each


def direct_levels(node: TreeNode, at_rest: bool = False) -> List[TreeNode]:
    """Return a container and its levels up to a Concurrence or an Iterator, innermost first.

    What runs in the other branches, and what is done of the items, belongs to others.

    `at_rest`: those that they would be, whatever runs.
    """
    levels = [node]
    for above in node.around() if at_rest else levels_above(node):
        if not is_direct(levels[-1]):
            break
        levels.append(above)
    return levels


def failure_context(
    node: TreeNode, record: StateRecord, is_counted: bool = False
) -> FailureContext:
    """Return what the visits so far say about a failure of a state of a container.

    `is_counted`: it is among them.

    With `step_back_across` its initial state is that before the container, in the levels above,
    where there is one.
    """
    context = node.records.failure_context(record, initial_label_of(node.machine), is_counted)
    before = _state_before(node) if node.settings.step_back_across else ''
    return context._replace(initial=before) if before else context


def _state_before(node: TreeNode) -> str:
    """Return the path of the state to which the policies above would step back from a container.

    It is '' where none has run before, or where a Concurrence or an Iterator lies between.
    """
    levels = direct_levels(node)
    for child, above in zip(levels, levels[1:]):
        context = above.records.failure_context(above.record(child.labels_from_parent[0]), '')
        name = above.in_force.policy.step_back_target(context)
        if name:
            return name if '/' in name else '{}/{}'.format(above.relative_path, name)
    return ''


# -- places


class TreePlace(NamedTuple):
    """One state of one container."""

    node: TreeNode
    label: str

    @property
    def path(self) -> str:
        """Return the path of the container, and the label."""
        return '{}/{}'.format(self.node.path, self.label)


def name_of(place: TreePlace, node: TreeNode) -> str:
    """Return a name of a place by which `place_named` finds it from a container.

    That is its label, or its path where it is in another container.
    """
    if place.node is node:
        return place.label
    return '/'.join(('', *filter(None, (place.node.relative_path, place.label))))


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


# -- which places may be named as preconditions of a state, whatever runs


def why_unfit(node: TreeNode, label: str, name: str) -> str:
    """Say why a name cannot be a precondition of a state, or '' where it can.

    A name without '/' is a label of the state's own container, any other one a path.
    """
    if '/' not in name and not (node.site.is_container and name in node.labels()):
        return _where_it_is(node, name) or _unknown(node, label, name)
    place = place_named(node, name, at_rest=True)
    if place is None:
        return _unknown(node, label, name)
    if place.node is node and place.label == label:
        return 'it is the state itself'
    if _is_around(place, node):
        return 'it is a container around the state, and runs meanwhile'
    if place.node is not node and not place.node.site.is_container:
        return 'a state of a Concurrence or an Iterator cannot be run alone'
    if _is_in_iterator(place, node):
        return 'it is in an Iterator, and there is no item where it is run alone'
    return ''


def allowed_for(node: TreeNode, label: str) -> str:
    """Say which names may be preconditions of a state."""
    elsewhere = 'PATH/LABEL of a state of another container'
    if not node.site.is_container:
        return elsewhere
    return 'the labels of the other states of {}: {}; or {}'.format(
        node.path, ', '.join(sorted(other for other in node.labels() if other != label)), elsewhere
    )


def _unknown(node: TreeNode, label: str, name: str) -> str:
    names = {
        '{}/{}'.format(each.relative_path, state)
        for each in nodes_of(node.top().machine)
        for state in each.labels()
    }
    if node.site.is_container:
        names.update(node.labels())
    own = {label, '{}/{}'.format(node.relative_path, label)}
    return 'there is no such state' + did_you_mean(name, names - own)


def _where_it_is(node: TreeNode, name: str) -> str:
    paths = [
        '{}/{}'.format(each.relative_path, name)
        for each in nodes_of(node.top().machine)
        if each is not node and name in each.labels()
    ]
    return 'in other containers there is ' + ', '.join(sorted(paths)) if paths else ''


def _is_around(place: TreePlace, node: TreeNode) -> bool:
    return any(
        each.parent is place.node and each.labels_from_parent[0] == place.label
        for each in (node, *node.around())
    )


def _is_in_iterator(place: TreePlace, node: TreeNode) -> bool:
    """Whether an Iterator lies between a place and what is around both."""
    common = (node, *node.around())
    return any(
        isinstance(link.outer_container, smach.Iterator)
        for each in (place.node, *place.node.around())
        if each not in common
        for link in links_to(each)
    )
