"""Sends a machine to a place as an operator has asked, at a state boundary."""

from typing import NamedTuple, Optional, Tuple

from ..asking.question import names
from ..control.control import Jump
from ..machine.jump_path import JumpPath, jump_path_to, repeated_on, why_closed_on
from ..machine.places import TreePlace, place_at
from ..machine.repeats import why_closed
from ..machine.tree_node import TreeNode
from ..records.events import EventKind
from ..smach_private import current_label_of, is_executing
from .jump_entry import missing_for, prepare_entry
from .transitions import go_to


class Prospect(NamedTuple):
    """The effects of sending a machine to a place: the checks of an expert's jump."""

    why_not: str  # it cannot be entered now, or '' where it can
    missing: Tuple[str, ...] = ()  # input keys that it would not find
    repeats: Tuple[str, ...] = ()  # guarded states (`on_retry`) that may be repeated


def jump_path_for(place: TreePlace) -> JumpPath:
    """Return the way to a place from the innermost container around it that runs.

    It is that from its own container where none runs.
    """
    sent: Optional[TreeNode] = place.node
    while sent is not None and not is_executing(sent.machine):
        sent = sent.parent
    way = jump_path_to(sent, place) if sent is not None else None
    return way or JumpPath((), place.node, (place,))


def prospect_of(place: TreePlace, written: Tuple[str, ...] = ()) -> Prospect:
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
        return Prospect('{} cannot be entered now: {}'.format(way.down[-1].label, closed_now))
    return Prospect('', missing_for(way, written), repeated_on(way))


def make_jump(node: TreeNode, jump: Jump) -> bool:
    """Make the jump that was asked for, and return whether it was made.

    To be called at a state boundary, with the machine's lock held where the engine holds it. What
    has come in between may prevent it. A warning tells so.
    """
    label = current_label_of(node.machine)
    place = place_at(node, jump.container, jump.state)
    way = jump_path_to(node, place) if place is not None else None
    why_not = _why_not(way, jump)
    if way is None or why_not:
        node.warn('is not sent to {}: {}'.format(jump.named(), why_not), label)
        return False
    node.record(label).forget_entry()  # it may have been led to, and is not entered
    entry = prepare_entry(way, jump.written, 'sent')
    node.records.take_up_work()
    by = jump.by or 'an operator'
    data = {'missing_keys': list(entry.missing), 'userdata': entry.userdata}
    if jump.container:
        data['to'] = way.down[-1].path
    node.emit(EventKind.SENT, state=label, target=way.first, by=jump.by, text=jump.text, data=data)
    go_to(
        node,
        "State machine sent by {} to '{}' instead of '{}'".format(by, jump.named(), label),
        way.first,
    )
    return True


def _why_not(way: Optional[JumpPath], jump: Jump) -> str:
    if way is None or way.left:
        return 'there is no such state'
    prospect = _prospect_on(way, jump.written)
    unconfirmed = sorted(set(prospect.repeats).difference(jump.repeats))
    if unconfirmed and not prospect.why_not:
        return 'it may repeat {}, which nobody has confirmed'.format(', '.join(unconfirmed))
    return prospect.why_not
