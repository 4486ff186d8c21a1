"""Checks which places may be named as preconditions of a state, whatever runs."""

from typing import List

import smach

from ..machine.nesting import nodes_of
from ..machine.tree_node import TreeNode
from ..settings.unfit_names import did_you_mean
from .handing_over import links_to
from .place import TreePlace, place_named


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


def _around(node: TreeNode) -> List[TreeNode]:
    """Return a container and all wrapped ones around it."""
    found = [node]
    while found[-1].parent is not None:
        found.append(found[-1].parent)
    return found


def _is_around(place: TreePlace, node: TreeNode) -> bool:
    return any(each.parent is place.node and each.below[0] == place.label for each in _around(node))


def _is_in_iterator(place: TreePlace, node: TreeNode) -> bool:
    """Whether an Iterator lies between a place and what is around both."""
    common, inner = _around(node), place.node
    while inner.parent is not None and not any(inner is each for each in common):
        if any(isinstance(link.above, smach.Iterator) for link in links_to(inner)):
            return True
        inner = inner.parent
    return False
