"""Comes to a place, whoever sends the machine there: the oracle, or an operator at a boundary.

An Iterator that has failed or was left goes on there with the item that was not finished. A script
that is started over has its userdata as it was at first, in all containers of the tree.
"""

from typing import Collection, Dict, NamedTuple, Optional, Tuple, cast

from ..asking.question import names
from ..branches.iterator_wrapper import ask_to_go_on
from ..checkpoint.resuming import forget_resumed
from ..control.control import Jump
from ..decision.ways import KEEP, RESTORE
from ..machine.nesting import nodes_of, settle_ways
from ..machine.places import (
    JumpPath,
    TreePlace,
    jump_path_to,
    missing_on,
    place_at,
    repeated_on,
    why_closed_on,
)
from ..machine.repeats import leave_for, why_closed
from ..machine.tree_node import TreeNode
from ..machine.userdata import keys_of_others, missing_keys, restore
from ..records.events import EventKind
from ..smach_private import current_label_of, data_of, is_executing, remapping_of
from .transitions import go_to


def prepare_entry(way: JumpPath, written: Collection[str], sent: str) -> Dict[str, object]:
    """Put the userdata back where the settings say so, and note in which states containers begin.

    To be called in the thread of the container that holds the whole way, its lock held.

    :param written: its userdata keys that survive a restore.
    :param sent: what is done, for a warning.
    :returns: what is told of the entry: the input keys that it does not find, and what was done
        with the userdata.
    """
    node, target = way.meeting_node, way.first_label
    forget_resumed(node)
    missing = missing_for(way, written)
    snapshot = node.record(target).snapshot if node.in_force.userdata == RESTORE else None
    if snapshot is not None:
        deep = node.in_force.deep_copy_keys
        stay = keys_of_others(node.machine, snapshot, deep).union(written)
        restore(data_of(node.machine.userdata), snapshot, stay, deep)
    leave_for(node, target, way.entered_places[1:])
    for place in way.entered_places:
        ask_to_go_on(place.node, place.label)
    if missing:
        place = way.place
        place.node.warn(
            '{} there without its input keys {}'.format(sent, ', '.join(missing)), place.label
        )
    node.record(target).go_down(way.entered_places[1:])
    return {'missing_keys': list(missing), 'userdata': KEEP if snapshot is None else RESTORE}


def plain_entry(node: TreeNode, label: str, userdata: str = KEEP) -> Dict[str, object]:
    """Return what is told of an entry of a state with the userdata that are there."""
    missing = missing_keys(node.machine, label, data_of(node.machine.userdata))
    return {'missing_keys': list(missing), 'userdata': userdata}


def missing_for(way: JumpPath, written: Collection[str]) -> Tuple[str, ...]:
    """Return the input keys that a place would not find.

    :param written: keys of the container that holds the whole way, written for it.
    """
    missing = missing_on(way, written)
    node, label = way.place
    if not missing or node is not way.meeting_node:  # keys of its own may have the same names
        return missing
    remapping = remapping_of(node.machine, label)
    return tuple(key for key in missing if remapping.get(key, key) not in written)


# -- a script that is started over


def keep_start(node: TreeNode) -> None:
    """Keep the userdata of a machine and of those in it, before its first state.

    References are kept, and copies of `deep_copy_keys`, as in any snapshot. Branches of
    Concurrences and Iterators have no userdata of their own.
    """
    node.tree.restarts.keep(
        {each: each.snapshot() for each in nodes_of(node.machine) if each.site.is_container}
    )


def start_over(node: TreeNode, target: str) -> Dict[str, object]:
    """Put the userdata of a machine, and of those in it, back to that of the start. Count it.

    :returns: what is told of the entry.
    """
    restarts = node.tree.restarts
    restarts.count += 1
    for each in nodes_of(node.machine):
        userdata = restarts.userdata.get(each)
        if userdata is not None:
            deep = each.in_force.deep_copy_keys
            # those in it get their input keys as they begin
            stay = keys_of_others(each.machine, userdata, deep) if each is node else ()
            restore(data_of(each.machine.userdata), userdata, stay, deep)
    leave_for(node, target)
    ask_to_go_on(node, target)
    return plain_entry(node, target, 'start')


# -- sent by an operator, at a state boundary


class Prospect(NamedTuple):
    """The effects of sending a machine to a place: the checks of an expert's jump."""

    why_not: str  # it cannot be entered now, or '' where it can
    missing: Tuple[str, ...] = ()  # input keys that it would not find
    repeats: Tuple[str, ...] = ()  # guarded states (`on_retry`) that may be repeated


def jump_path_for(place: TreePlace) -> JumpPath:
    """Return the way to a place from the innermost container around it that runs.

    It is that from its own container where none runs.
    """
    around = (place.node, *place.node.around())
    sent = next((each for each in around if is_executing(each.machine)), None)
    way = jump_path_to(sent, place) if sent is not None else None
    return way or JumpPath((), place.node, (place,))


def prospect_of(place: TreePlace, written: Tuple[str, ...]) -> Prospect:
    """Return what comes of sending the machine to a place.

    :param written: userdata keys that are written for it.
    """
    node, label = place
    labels = list(node.labels())
    if label not in labels:
        closed = {each: why_closed(node, each) for each in labels}
        return Prospect(
            '{} has no state {!r} to go to; allowed: {}'.format(
                node.path, label, names(each for each in labels if not closed[each])
            )
        )
    return _prospect_on(jump_path_for(place), written)


def _prospect_on(way: JumpPath, written: Tuple[str, ...]) -> Prospect:
    closed_now = why_closed_on(way)
    if closed_now:
        return Prospect('{} cannot be entered now: {}'.format(way.place.label, closed_now))
    return Prospect('', missing_for(way, written), repeated_on(way))


def make_jump(node: TreeNode, jump: Jump, is_stopped: bool) -> bool:
    """Make the jump that was asked for, and return whether it was made.

    To be called at a state boundary, with the machine's lock held where the engine holds it. What
    has come in between may prevent it. A warning tells so.

    :param is_stopped: whether the machine has obeyed a preempt that came in between.
    """
    label = current_label_of(node.machine)
    way = jump_path_to(node, place_at(node, jump.container, jump.state))
    why_not = 'it was preempted since' if is_stopped else _why_not(way, jump)
    if why_not:
        node.warn('is not sent to {}: {}'.format(jump.named(), why_not), label)
        return False
    way = cast('JumpPath', way)
    settle_ways(node, None)
    node.record(label).forget_entry()  # it may have been led to, and is not entered
    data = prepare_entry(way, jump.written, 'sent')
    node.records.take_up_work()
    by = jump.by or 'an operator'
    if jump.container:
        data['to'] = way.place.path
    node.emit(
        EventKind.SENT, state=label, target=way.first_label, by=jump.by, text=jump.text, data=data
    )
    go_to(
        node,
        "State machine sent by {} to '{}' instead of '{}'".format(by, jump.named(), label),
        way.first_label,
    )
    return True


def _why_not(way: Optional[JumpPath], jump: Jump) -> str:
    if way is None or way.left_containers:
        return 'there is no such state'
    prospect = _prospect_on(way, jump.written)
    unconfirmed = sorted(set(prospect.repeats).difference(jump.repeats))
    if unconfirmed:  # none where it cannot be entered
        return 'it may repeat {}, which nobody has confirmed'.format(', '.join(unconfirmed))
    return prospect.why_not
