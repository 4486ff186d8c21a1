"""Userdata on its way between containers, through the input and output keys of its author."""

from typing import Any, Iterator, Mapping, NamedTuple, Sequence, Set, Tuple

import smach

from ..machine.tree_node import TreeNode
from ..machine.userdata_view import constants_of
from ..smach_private import data_of, remapping_in, states_of


class Link(NamedTuple):
    """A container in the container around it, which may be a Concurrence or an Iterator."""

    above: Any
    label: str
    below: Any

    @property
    def remapping(self) -> Mapping[str, str]:
        """Key of the container above by key of the one below, where they differ."""
        return remapping_in(self.above, self.label)


def links_to(node: TreeNode) -> Iterator[Link]:
    """Yield the links from the wrapped container above one to it, from above to below.

    The top machine has none.
    """
    above: Any = node.parent.machine if node.parent is not None else None
    for label in node.below:
        below = child_of(above, label)
        yield Link(above, label, below)
        above = below


def child_of(container: Any, label: str) -> Any:
    """Return a state of a container of whatever kind."""
    if isinstance(container, smach.StateMachine):
        return states_of(container)[label]
    return container.get_children()[label]


def hand_down(link: Link) -> None:
    """Give a container its input keys, as when it begins."""
    given = {**data_of(link.above.userdata), **_constants(link)}
    for key, named in _inputs(link):
        if named in given:
            link.below.userdata[key] = given[named]


def hand_up(link: Link, written: Set[str], into: Any) -> Set[str]:
    """Hand output keys of a container that were written to the one above it.

    :param into: where they are written, by keys of the container above.
    :returns: the keys written there.
    """
    found = set()
    for key in link.below.get_registered_output_keys():
        if key in written and key in data_of(link.below.userdata):
            named = link.remapping.get(key, key)
            into[named] = data_of(link.below.userdata)[key]
            found.add(named)
    return found


def hand_on(link: Link, written: Set[str], into: Any) -> Set[str]:
    """Hand what was written in a container to the one below it that runs, by its input keys.

    :param into: where it is written, by keys of the container below.
    :returns: the keys written there.
    """
    found = set()
    for key, named in _inputs(link):
        if named in written and named in data_of(link.above.userdata):
            into[key] = data_of(link.above.userdata)[named]
            found.add(key)
    return found


def _inputs(link: Link) -> Sequence[Tuple[str, str]]:
    return [(key, link.remapping.get(key, key)) for key in link.below.get_registered_input_keys()]


def _constants(link: Link) -> Mapping[str, Any]:
    return (
        constants_of(link.above, link.label) if isinstance(link.above, smach.StateMachine) else {}
    )
