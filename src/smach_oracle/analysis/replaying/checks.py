"""Holds a replay against the record that it follows."""

from typing import Callable, List, Optional, Sequence

from smach_oracle.oracle.records import facts
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind

from ..bag_events import BagError
from .menus import chosen_way
from .replay import NOT_KNOWN, Replay, ReplayedDecision

_ROUNDING = 1e-9


def beginnings(trials: Sequence[Sequence[Event]], begin: Callable[[], Replay]) -> List[int]:
    """Return the numbers of trials that began with nothing learned, from 0. The first is one.

    A program that keeps no rates in a file begins so. No event says that. It shows in the rates,
    which are those of an oracle that has seen only the trials since. A program whose rates show
    nothing is not found. `begin`: returns an oracle that has learned nothing.

    :raises BagError: where the rates or decisions of a trial fit no beginning.
    """
    found, own = [0], begin()
    for number, trial in enumerate(trials):
        wrong = _follow(own, trial)
        if wrong is None:
            continue
        # the last one that was found may have begun earlier than its first failures tell
        for first in range(number, found[-2] if len(found) > 1 else 0, -1):
            own = begin()
            if all(_follow(own, each) is None for each in trials[first : number + 1]):
                found = [each for each in found if each < first] + [first]
                break
        else:
            raise wrong
    return found


def _follow(own: Replay, trial: Sequence[Event]) -> Optional[BagError]:
    """Follow a trial. Return what does not fit, or None."""
    try:
        for event in that_count(trial):
            _check_rate(own, event)
            done = own.take(event)
            if done is not None:
                _check_decision(done, event)
    except BagError as err:
        return err
    return None


def that_count(trial: Sequence[Event]) -> List[Event]:
    """Leave out what a program told before it was killed, and had not stored yet.

    The machine went on from before that.
    """
    found: List[Event] = []
    for event in trial:
        stored = facts.last_stored(event) if event.kind == EventKind.RESUMED else -1
        if stored >= 0:
            found = [each for each in found if each.seq <= stored]
        found.append(event)
    return found


def _check_rate(own: Replay, event: Event) -> None:
    if event.kind != EventKind.FAILURE or event.failure_kind == FailureKind.INTERRUPTED:
        return
    if abs(own.rate(event) - event.rate) > _ROUNDING:
        raise BagError(
            '{}: {} failed at a rate of {:.4f}, by the record of its results it is {:.4f}'.format(
                event.trial_id, event.state, event.rate, own.rate(event)
            )
        )


def _check_decision(done: ReplayedDecision, event: Event) -> None:
    if done.action != NOT_KNOWN and not done.is_as(event):
        raise BagError(
            '{}: {}: it decided {}, where its own settings say {}'.format(
                event.trial_id,
                event.state,
                ' '.join(filter(None, (event.outcome, chosen_way(event)))),
                ' '.join(filter(None, (done.action, done.way))),
            )
        )
