"""The way from a failure to a place, and what is told of it before the machine goes there."""
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Set, Tuple

import smach

from ..machine.protocols import Machine
from ..machine.repeats import repeated_by_going_to, why_closed
from ..machine.tree_node import TreeNode
from ..machine.userdata_view import constants_of, keys_after_jump
from .levels import levels_above
from .place import Place


class Way(NamedTuple):
    """The way from a container to a place: out to where they meet, and down again.

    `left`: the containers that are left, innermost first. `meets`: the innermost container that
    holds both. `down`: its own state that is entered, then the states in which the containers below
    it begin; the last one is the place.
    """

    left: Tuple[TreeNode, ...]
    meets: TreeNode
    down: Tuple[Place, ...]

    @property
    def first(self) -> str:
        """Label of the state of `meets` that is entered."""
        return self.down[0].label


def way_to(node: TreeNode, place: Place) -> Optional[Way]:
    """Return the way from a container that is being executed to a place; None: there is none."""
    levels = [node, *levels_above(node)]
    down: List[Place] = [place]
    while not any(down[0].node is level for level in levels):
        below = down[0].node
        if below.parent is None:
            return None
        down.insert(0, Place(below.parent, below.below[0]))
    index = next(i for i, level in enumerate(levels) if level is down[0].node)
    return Way(tuple(levels[:index]), levels[index], tuple(down))


# -- what is told of a place before the machine goes there


def why_closed_on(way: Way) -> str:
    """Return why a place cannot be entered now, or what lies on the way down; '' where it can."""
    for place in way.down:
        why = why_closed(place.node, place.label)
        if why:
            return why if place is way.down[-1] else '{} {}'.format(place.path, why)
    return ''


def repeated_on(way: Way) -> Tuple[str, ...]:
    """Return the guarded states that may be repeated if the machine goes to a place."""
    return repeated_by_going_to(way.meets, way.first)


def missing_on(way: Way, written: Iterable[str]) -> Tuple[str, ...]:
    """Return the input keys of a place's state that would be missing after the jump.

    :param written: keys of the container `meets` that survive a restore.
    """
    keys = set(keys_after_jump(way.meets, way.first, tuple(written)))
    for above, below in zip(way.down, way.down[1:]):
        keys = _keys_below(above.node, below.node, keys)
    node, label = way.down[-1]
    present = keys.union(constants_of(node.machine, label))
    return tuple(sorted(_missing(node.machine, label, node.machine._states[label], present)))


def _missing(machine: Machine, label: str, state: smach.State, present: Set[str]) -> List[str]:
    remapping = machine._remappings.get(label) or {}
    return [key for key in state.get_registered_input_keys()
            if remapping.get(key, key) not in present]


def _keys_below(above: TreeNode, below: TreeNode, keys: Set[str]) -> Set[str]:
    """Return the userdata keys of a container when it begins, from those of the one above it."""
    container: Any = above.machine
    for label in below.below:
        child: Any = _child(container, label)
        remapping: Dict[str, str] = (getattr(container, '_remappings', None) or {}).get(label) or {}
        keys = set(child.userdata._data).union(
            key for key in child.get_registered_input_keys() if remapping.get(key, key) in keys)
        item = getattr(child, '_items_label', None)
        if item is not None:  # an Iterator: its state works on its own userdata
            keys.add(item)
        container = child
    return keys


def _child(container: Any, label: str) -> Any:
    if isinstance(container, smach.StateMachine):
        return container._states[label]
    return container.get_children()[label]
