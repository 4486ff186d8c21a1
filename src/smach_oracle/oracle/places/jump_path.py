"""The way from a failure to a place, and what is told of it before the machine goes there."""

from typing import FrozenSet, Iterable, List, NamedTuple, Optional, Set, Tuple

from ..machine.repeats import repeated_by_going_to, why_closed
from ..machine.snapshots import WriteWatch
from ..machine.tree_node import TreeNode
from ..machine.userdata_view import keys_after_jump, missing_keys
from ..smach_private import data_of, items_label_of, states_of
from .handing_over import links_to
from .levels import levels_above
from .place import TreePlace


class JumpPath(NamedTuple):
    """The way from a container to a place: out to where they meet, and down again.

    `left`: the containers that are left, innermost first. `meets`: the innermost container that
    holds both. `down`: its own state that is entered, then the states in which the containers below
    it begin. The last one is the place.
    """

    left: Tuple[TreeNode, ...]
    meets: TreeNode
    down: Tuple[TreePlace, ...]

    @property
    def first(self) -> str:
        """Return the label of the state of `meets` that is entered."""
        return self.down[0].label

    def kept(self, watch: WriteWatch) -> FrozenSet[str]:
        """Return the keys that a recovery wrote and that survive a restore where the ways meet.

        None survives where the container in which they were written is left.
        """
        return frozenset(watch.written_in(self.meets.machine))


def jump_path_to(node: TreeNode, place: TreePlace) -> Optional[JumpPath]:
    """Return the way from a container that is being executed to a place.

    None means there is none.
    """
    if place.node is node:
        return JumpPath((), node, (place,))
    levels = [node, *levels_above(node)]
    down: List[TreePlace] = [place]
    while not any(down[0].node is level for level in levels):
        below = down[0].node
        if below.parent is None:
            return None
        down.insert(0, TreePlace(below.parent, below.below[0]))
    index = next(i for i, level in enumerate(levels) if level is down[0].node)
    return JumpPath(tuple(levels[:index]), levels[index], tuple(down))


# -- what is told of a place before the machine goes there


def why_closed_on(way: JumpPath) -> str:
    """Return why a place, or one on the way down, cannot be entered now, '' where it can."""
    for place in way.down:
        why = why_closed(place.node, place.label)
        if why:
            return why if place is way.down[-1] else '{} {}'.format(place.path, why)
    return ''


def closed_in_words(way: JumpPath, name: str) -> str:
    """Say that a place of this name, or one on the way down, is closed, or ''.

    It is a clause.
    """
    why = why_closed_on(way)
    # of what lies on the way down it names the path
    return '{} {}'.format(name, why) if why and not why.startswith(way.meets.path) else why


def repeated_on(way: JumpPath) -> Tuple[str, ...]:
    """Return the guarded states that may be repeated if the machine goes to a place."""
    return repeated_by_going_to(way.meets, way.first)


def missing_on(way: JumpPath, written: Iterable[str]) -> Tuple[str, ...]:
    """Return the input keys of a place's state that would be missing after the jump.

    :param written: keys of the container `meets` that survive a restore.
    """
    node, label = way.down[-1]
    if not states_of(node.machine)[label].get_registered_input_keys():
        return ()
    keys = set(keys_after_jump(way.meets, way.first, tuple(written)))
    for below in way.down[1:]:
        keys = _keys_below(below.node, keys)
    return missing_keys(node.machine, label, keys)


def _keys_below(below: TreeNode, keys: Set[str]) -> Set[str]:
    """Return the userdata keys of a container when it begins, from those of the one above it."""
    for link in links_to(below):
        child = link.below
        keys = set(data_of(child.userdata)).union(
            key for key in child.get_registered_input_keys() if link.remapping.get(key, key) in keys
        )
        item = items_label_of(child)
        if item is not None:  # an Iterator: its state works on its own userdata
            keys.add(item)
    return keys
