"""Prepares a place before a machine goes there, whoever sends it."""

from typing import Collection, NamedTuple, Tuple

from ..checkpoint.resuming import forget_resumed
from ..machine.repeats import leave_for
from ..machine.snapshots import restore
from ..places.way import Way, missing_on
from .going_on import ask_to_go_on


class Entry(NamedTuple):
    """The way in which a place is entered."""

    missing: Tuple[str, ...]  # input keys that it does not find
    userdata: str  # 'restore' or 'keep'


def prepare_entry(way: Way, written: Collection[str], sent: str) -> Entry:
    """Put the userdata back where the settings say so, and note in which states containers begin.

    To be called in the thread of the container that holds the whole way, its lock held.

    :param written: its userdata keys that survive a restore.
    :param sent: what is done, for a warning.
    """
    node, target = way.meets, way.first
    forget_resumed(node)
    missing = missing_for(way, written)
    snapshot = node.record(target).snapshot if node.settings.userdata == 'restore' else None
    if snapshot is not None:
        restore(node.machine.userdata._data, snapshot, written, node.in_force.deep_copy_keys)
    leave_for(node, target, way.down[1:])
    for place in way.down:
        ask_to_go_on(place.node, place.label)
    if missing:
        place = way.down[-1]
        place.node.warn(
            '{} there without its input keys {}'.format(sent, ', '.join(missing)), place.label
        )
    node.record(target).go_down(way.down[1:])
    return Entry(missing, 'keep' if snapshot is None else 'restore')


def missing_for(way: Way, written: Collection[str]) -> Tuple[str, ...]:
    """Return the input keys that a place would not find.

    :param written: keys of the container that holds the whole way, written for it.
    """
    missing = missing_on(way, written)
    node, label = way.down[-1]
    if not missing or node is not way.meets:  # keys of its own may have the same names
        return missing
    remapping = node.machine._remappings.get(label) or {}
    return tuple(key for key in missing if remapping.get(key, key) not in written)
