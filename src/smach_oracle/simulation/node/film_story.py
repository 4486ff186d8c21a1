"""Tells in captions what a machine does, from the events of its oracle."""

from typing import Callable, Dict, NamedTuple, Optional

from smach_oracle.msg import OracleEvent

from ..pictures.caption import BLUE, GREEN, ORANGE, RED, Caption

SUCCEEDED = 'succeeded'  # the outcome of a trial that did
# what an expert answers, by the outcome of the event
ANSWERS = {
    'goto': 'go on with {}',
    'supersede': 'it is done, and ended with {}',
    'interface': 'helps with {}',
    'give_up': 'give up',
}


class Told(NamedTuple):
    """A caption. A film that holds stands still, so that people can read it."""

    caption: Caption
    holds: bool = True


def told(event: OracleEvent) -> Optional[Told]:
    """Return the caption for an event, or None where there is none."""
    tell = _TOLD.get(event.kind)
    return tell(event) if tell else None


def _state(event: OracleEvent) -> Told:
    return Told(Caption(event.state), holds=False)


def _failure(event: OracleEvent) -> Told:
    return Told(Caption(event.state + ' failed', _last_line(event.text) or event.outcome, RED))


def _precondition(event: OracleEvent) -> Told:
    words = '{}, a precondition of {}'.format(event.target, event.state)
    return Told(Caption('Oracle', words, BLUE), holds=False)


def _answer(event: OracleEvent) -> Told:
    answer = ANSWERS.get(event.outcome, event.outcome + ' {}').format(event.target)
    return Told(Caption('Answer of ' + (event.by or 'an expert'), answer, ORANGE))


def _end(event: OracleEvent) -> Told:
    colour = GREEN if event.outcome == SUCCEEDED else RED
    return Told(Caption('End of the trial', event.outcome or _last_line(event.text), colour))


def _last_line(text: str) -> str:
    """Return that line: of a traceback it says what was wrong."""
    return ''.join(text.strip().splitlines()[-1:]).strip()


_TOLD: Dict[int, Callable[[OracleEvent], Told]] = {
    OracleEvent.STATE_START: _state,
    OracleEvent.FAILURE: _failure,
    OracleEvent.DECISION: lambda event: Told(Caption('Oracle', event.text, BLUE)),
    OracleEvent.PRECONDITION_START: _precondition,
    OracleEvent.QUERY_ANSWERED: _answer,
    OracleEvent.TRIAL_END: _end,
}
