"""The way from a failure to a place: what is told of it before, and userdata on its way between.

Userdata goes from container to container through the input and output keys of its author.
"""

from typing import (
    Collection,
    FrozenSet,
    Iterable,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    Tuple,
    Union,
)

import smach

from ..decision.ways import KEEP
from ..smach_private import constants_of, data_of, items_label_of, states_of
from .places import ContainerLink, TreePlace, levels_above, links_to
from .repeats import repeated_by_going_to, why_closed
from .snapshots import UserdataGate, WriteWatch
from .tree_node import TreeNode
from .userdata_view import missing_keys


class JumpPath(NamedTuple):
    """The way from a container to a place: out to where they meet, and down again.

    `left_containers`: those that are left, innermost first. `meeting_node`: of the innermost one
    that holds both. `entered_places`: its own state that is entered, then the states in which the
    containers below it begin. The last one is the place.
    """

    left_containers: Tuple[TreeNode, ...]
    meeting_node: TreeNode
    entered_places: Tuple[TreePlace, ...]

    @property
    def first_label(self) -> str:
        """Return the label of the state of the `meeting_node` that is entered."""
        return self.entered_places[0].label

    def kept(self, watch: WriteWatch) -> FrozenSet[str]:
        """Return the keys that a recovery wrote and that survive a restore where the ways meet.

        None survives where the container in which they were written is left.
        """
        return frozenset(watch.written_in(self.meeting_node.machine))


def jump_path_to(node: TreeNode, place: Optional[TreePlace]) -> Optional[JumpPath]:
    """Return the way from a container that is being executed to a place.

    None means there is none. There is none where `place` is None.
    """
    if place is None:
        return None
    if place.node is node:
        return JumpPath((), node, (place,))
    levels = [node, *levels_above(node)]
    down: List[TreePlace] = [place]
    while not any(down[0].node is level for level in levels):
        below = down[0].node
        if below.parent is None:
            return None
        down.insert(0, TreePlace(below.parent, below.labels_from_parent[0]))
    index = next(i for i, level in enumerate(levels) if level is down[0].node)
    return JumpPath(tuple(levels[:index]), levels[index], tuple(down))


# -- what is told of a place before the machine goes there


def why_closed_on(way: JumpPath) -> str:
    """Return why a place, or one on the way down, cannot be entered now, '' where it can."""
    for place in way.entered_places:
        why = why_closed(place.node, place.label)
        if why:
            return why if place is way.entered_places[-1] else '{} {}'.format(place.path, why)
    return ''


def closed_in_words(way: JumpPath, why: str, name: str) -> str:
    """Say that a place of this name, or one on the way down, is closed, or ''.

    It is a clause. `why`: as `why_closed_on` has it.
    """
    # of what lies on the way down it names the path
    return '{} {}'.format(name, why) if why and not why.startswith(way.meeting_node.path) else why


def repeated_on(way: JumpPath) -> Tuple[str, ...]:
    """Return the guarded states that may be repeated if the machine goes to a place."""
    return repeated_by_going_to(way.meeting_node, way.first_label)


def missing_on(way: JumpPath, written: Iterable[str]) -> Tuple[str, ...]:
    """Return the input keys of a place's state that would be missing after the jump.

    :param written: keys of the container of `meeting_node` that survive a restore.
    """
    node, label = way.entered_places[-1]
    if not states_of(node.machine)[label].get_registered_input_keys():
        return ()
    keys = set(_keys_after_jump(way.meeting_node, way.first_label, tuple(written)))
    for below in way.entered_places[1:]:
        keys = _keys_below(below.node, keys)
    return missing_keys(node.machine, label, keys)


def _keys_after_jump(node: TreeNode, label: str, written: Collection[str]) -> Tuple[str, ...]:
    """Return the container's userdata keys as they would be after a jump to a state."""
    now = data_of(node.machine.userdata)
    snapshot = node.record(label).snapshot
    if node.in_force.userdata == KEEP or snapshot is None:
        return tuple(now)
    return tuple(set(snapshot).difference(written).union(key for key in written if key in now))


def _keys_below(below: TreeNode, keys: Set[str]) -> Set[str]:
    """Return the userdata keys of a container when it begins, from those of the one above it."""
    for link in links_to(below):
        child = link.inner_container
        keys = set(data_of(child.userdata)).union(
            key for key in child.get_registered_input_keys() if link.remapping.get(key, key) in keys
        )
        item = items_label_of(child)
        if item is not None:  # an Iterator: its state works on its own userdata
            keys.add(item)
    return keys


# -- userdata between containers


def hand_down(link: ContainerLink) -> None:
    """Give a container its input keys, as when it begins."""
    given = {**data_of(link.outer_container.userdata), **_constants(link)}
    for key, named in _inputs(link):
        if named in given:
            link.inner_container.userdata[key] = given[named]


def hand_up(
    link: ContainerLink, written: Set[str], into: Union[UserdataGate, smach.UserData]
) -> Set[str]:
    """Hand output keys of a container that were written to the one above it.

    :param into: where they are written, by keys of the container above.
    :returns: the keys written there.
    """
    outputs = link.inner_container.get_registered_output_keys()
    pairs = ((key, link.remapping.get(key, key)) for key in outputs)
    return _hand_over(link.inner_container, pairs, written, into)


def hand_on(
    link: ContainerLink, written: Set[str], into: Union[UserdataGate, smach.UserData]
) -> Set[str]:
    """Hand what was written in a container to the one below it that runs, by its input keys.

    :param into: where it is written, by keys of the container below.
    :returns: the keys written there.
    """
    pairs = ((named, key) for key, named in _inputs(link))
    return _hand_over(link.outer_container, pairs, written, into)


def _hand_over(
    container: smach.Container,
    pairs: Iterable[Tuple[str, str]],
    written: Set[str],
    into: Union[UserdataGate, smach.UserData],
) -> Set[str]:
    """Hand over keys of a container that were written, each by its name there and its new one."""
    data, found = data_of(container.userdata), set()
    for key, new in pairs:
        if key in written and key in data:
            into[new] = data[key]
            found.add(new)
    return found


def _inputs(link: ContainerLink) -> Sequence[Tuple[str, str]]:
    return [
        (key, link.remapping.get(key, key))
        for key in link.inner_container.get_registered_input_keys()
    ]


def _constants(link: ContainerLink) -> Mapping[str, object]:
    return (
        constants_of(link.outer_container, link.label)
        if isinstance(link.outer_container, smach.StateMachine)
        else {}
    )
