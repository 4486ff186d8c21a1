"""The wait of one container, with what the log and the observers are told of it."""

import time
from typing import Any, ContextManager, NamedTuple, Protocol

import smach

from ..records.events import EventKind
from ..scope.scope import Scope
from .control import Control
from .hold import HeldBy, Hold, LetGo

_WHY = {
    HeldBy.PAUSE: 'paused',
    HeldBy.BREAKPOINT: 'paused by a breakpoint',
    HeldBy.CONFIRM: 'waits for a confirmation',
}


class HoldTeller(Protocol):
    """A container that tells the observers of what goes on in it (`TreeNode`)."""

    def emit(self, kind: EventKind, **fields: Any) -> None:
        """Tell the observers."""


class Wait(NamedTuple):
    """The parts of its container that a wait needs."""

    teller: HoldTeller
    clocks: ContextManager[None]  # time limits around it stand still within
    scope: Scope  # ends it


def wait_until_let_go(control: Control, hold: Hold, wait: Wait) -> LetGo:
    """Wait until the hold is let go, and return by what."""
    control.begin(hold)
    since_s = time.monotonic()
    let_go = None
    try:
        _tell_begin(hold, control.paused_by, wait.teller)
        with wait.clocks:
            let_go = control.wait(hold, wait.scope)
            return let_go
    finally:
        control.end(hold)
        outcome = let_go.value if let_go is not None else 'stopped'  # by Ctrl-C in this thread
        _tell_end(hold, outcome, time.monotonic() - since_s, wait.teller)


def _tell_begin(hold: Hold, paused_by: str, teller: HoldTeller) -> None:
    why, place = _WHY[hold.held_by], hold.place
    smach.logwarn('{}: {} before {}'.format(place.path, why, place.state))
    teller.emit(
        EventKind.HOLD_START,
        state=place.state,
        outcome=hold.held_by.value,
        by='' if hold.held_by is HeldBy.CONFIRM else paused_by,
        text='{} before {}'.format(why, place.state),
    )


def _tell_end(hold: Hold, outcome: str, waited_s: float, teller: HoldTeller) -> None:
    state = hold.place.state
    smach.loginfo(
        '{}: {} before {}, after {:.1f} s'.format(hold.place.path, outcome, state, waited_s)
    )
    teller.emit(
        EventKind.HOLD_END,
        state=state,
        outcome=outcome,
        text='{} after {:.1f} s'.format(outcome, waited_s),
        data={'waited_s': round(waited_s, 3)},
    )
