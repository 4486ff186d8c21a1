"""Sends a container to a state as an operator has asked, at a state boundary."""
from typing import NamedTuple, Tuple

from ..asking.question import names
from ..branches.border import IteratorBorder, border_of
from ..control.control import Jump
from ..machine.repeats import leave_for, repeated_by_going_to, why_closed
from ..machine.snapshots import restore
from ..machine.tree_node import TreeNode
from ..machine.userdata_view import keys_after_jump, missing_keys
from ..records.events import EventKind
from .transitions import go_to


class Prospect(NamedTuple):
    """What comes of sending a container to a state: the checks of an expert's jump."""

    why_not: str  # it cannot be entered now; '' where it can
    missing: Tuple[str, ...]  # input keys that it would not find
    repeats: Tuple[str, ...]  # guarded states (`on_retry`) that may be repeated


def prospect_of(node: TreeNode, label: str, written: Tuple[str, ...] = ()) -> Prospect:
    """Return what comes of sending a container to a state.

    :param written: userdata keys that are written for it.
    """
    labels = list(node.labels())
    if label not in labels:
        closed = {each: why_closed(node, each) for each in labels}
        return Prospect('{} has no state {!r} to go to; allowed: {}'.format(
            node.path, label, names(each for each in labels if not closed[each])), (), ())
    closed_now = why_closed(node, label)
    if closed_now:
        return Prospect('{} cannot be entered now: {}'.format(label, closed_now), (), ())
    available = set(keys_after_jump(node, label, written)).union(written)
    return Prospect('', missing_keys(node.machine, label, available),
                    repeated_by_going_to(node, label))


def make_jump(node: TreeNode, jump: Jump) -> bool:
    """Make the jump that was asked for; return whether it was made.

    To be called at a state boundary, with the machine's lock held where the engine holds it. What
    has come in between may prevent it; a warning tells so.
    """
    label, target = str(node.machine._current_label), jump.state
    prospect = prospect_of(node, target, jump.written)
    unconfirmed = sorted(set(prospect.repeats).difference(jump.repeats))
    why_not = prospect.why_not
    if unconfirmed and not why_not:
        why_not = 'it may repeat {}, which nobody has confirmed'.format(', '.join(unconfirmed))
    if why_not:
        node.warn('is not sent to {}: {}'.format(target, why_not), label)
        return False
    restored = _restore(node, jump)
    leave_for(node, target)
    forget_jump(node, label)
    if prospect.missing:
        node.warn('sent there without its input keys {}'.format(', '.join(prospect.missing)),
                  target)
    by = jump.by or 'an operator'
    node.emit(EventKind.SENT, state=label, target=target, by=jump.by, text=jump.text,
              data={'missing_keys': list(prospect.missing),
                    'userdata': 'restore' if restored else 'keep'})
    go_to(node, "State machine sent by {} to '{}' instead of '{}'".format(by, target, label),
          target)
    return True


def forget_jump(node: TreeNode, label: str) -> None:
    """Forget how the oracle wanted to enter a state to which it led, and which is not entered."""
    node.record(label).forget_entry()
    border = border_of(node.machine._states[label])
    if isinstance(border, IteratorBorder):
        border.ask_to_go_on(False)


def _restore(node: TreeNode, jump: Jump) -> bool:
    """Give the state the userdata of when it was last entered, where the settings say so."""
    snapshot = node.record(jump.state).snapshot
    if node.settings.userdata != 'restore' or snapshot is None:
        return False
    restore(node.machine.userdata._data, snapshot, jump.written, node.in_force.deep_copy_keys)
    return True


def tell_dropped(node: TreeNode, jump: Jump) -> None:
    """Tell that a container has ended before it could be sent anywhere."""
    node.warn('has ended before it could be sent to {}'.format(jump.state))
