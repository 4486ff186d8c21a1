"""Waits for an operator: before a state, before a precondition, between items."""

import time
from typing import Union

import smach

from ..control.control import HeldBy, HeldPlace, Hold, LetGo
from ..machine.tree_node import TreeNode
from ..records.events import EventKind
from ..scope.scope import Reason, Scope, standing_still
from ..settings.settings import CONFIRM_FIRST
from ..smach_private import Labels

_WHY = {
    HeldBy.PAUSE: 'paused',
    HeldBy.BREAKPOINT: 'paused by a breakpoint',
    HeldBy.CONFIRM: 'waits for a confirmation',
}


def wait_for_operator(
    node: TreeNode, below: Labels, name: str, autonomy: str, scope: Scope
) -> None:
    """Wait before something begins, where an operator holds it.

    :param below: labels of a Concurrence or an Iterator in the container, of which it is a part.
    :param name: its label, or that of a function.
    :param autonomy: of what begins, by its settings.
    :param scope: ends the wait.
    """
    control = node.tree.control
    if not control.is_set and autonomy != CONFIRM_FIRST:
        return
    place = HeldPlace('/'.join((node.path, *below)), name)
    confirms = control.level_of(place, autonomy) == CONFIRM_FIRST
    hold = control.hold_before(place, confirms, scope.reason is None)
    if hold is not None:
        hold.may_be_sent, hold.autonomy = False, autonomy
        wait_until_let_go(node, hold, scope, below)


def wait_until_let_go(
    node: TreeNode, hold: Hold, scope: Scope, below: Labels = ()
) -> Union[LetGo, Reason]:
    """Wait until a hold is let go, or `scope` is cancelled, and return by what.

    No lock of a machine is held. The time limits around what waits stand still, and the minutes of
    its trial.

    :param below: as in `wait_for_operator`.
    """
    control, place, since_s = node.tree.control, hold.place, time.monotonic()
    runs = node.execution.runs_around_below(below)
    control.begin(hold)
    let_go = None
    try:
        why = '{} before {}'.format(_WHY[hold.held_by], place.state)
        by = '' if hold.held_by is HeldBy.CONFIRM else control.paused_by
        smach.logwarn('{}: {}'.format(place.path, why))
        node.emit(EventKind.HOLD_START, place.state, hold.held_by.value, by=by, text=why)
        with standing_still(runs), node.tree.budget.paused():
            let_go = control.wait(hold, scope)
            return let_go
    finally:
        control.end(hold)
        outcome, waited_s = _in_words(let_go), time.monotonic() - since_s
        smach.loginfo(
            '{}: {} before {}, after {:.1f} s'.format(place.path, outcome, place.state, waited_s)
        )
        text, data = '{} after {:.1f} s'.format(outcome, waited_s), {'waited_s': round(waited_s, 3)}
        node.emit(EventKind.HOLD_END, place.state, outcome, text=text, data=data)


def _in_words(let_go: Union[LetGo, Reason, None]) -> str:
    if let_go is None:
        return 'stopped'  # by Ctrl-C in this thread
    if isinstance(let_go, LetGo):
        return let_go.value
    return (Reason.LEFT_BEHIND if let_go is Reason.EARLY_END else let_go).text
