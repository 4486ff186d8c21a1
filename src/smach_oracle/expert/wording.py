"""Failures and events in words, for every front end. Pure.

Text that a robot has sent comes out of `clean` fit for a terminal. A page shows it as text, never
as markup.
"""

import json
import unicodedata
from typing import Any, Union

from smach_oracle.msg import ExpertQueryGoal, OracleEvent
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import DECIDED_BY


def clean(text: str, lines: bool = False) -> str:
    """Drop what steers a terminal or turns the reading direction.

    :param lines: keep newlines.
    """
    return ''.join(_visible(character, lines) for character in text)


def still_runs(goal: ExpertQueryGoal) -> bool:
    """Whether a question is about a state that still runs. GOTO that state is to wait on."""
    return bool(goal.failure_kind == ExpertQueryGoal.STILL_RUNNING)


def standing_words(goal: ExpertQueryGoal) -> str:
    """Return how the state of a question stands, to follow its name."""
    return {
        ExpertQueryGoal.STILL_RUNNING: 'still runs',
        OracleEvent.INTERRUPTED: 'was interrupted',
        ExpertQueryGoal.HELD_BACK: 'is held back',
    }.get(goal.failure_kind, 'failed')


def failure_words(goal: ExpertQueryGoal) -> str:
    """Return how the state of a question failed, or that it still runs."""
    outcome = clean(goal.outcome)
    return {
        ExpertQueryGoal.STILL_RUNNING: 'still runs',
        OracleEvent.FAILING_OUTCOME: 'ended with the failing outcome {}'.format(outcome),
        OracleEvent.FELL_THROUGH: 'ended with {}, which would end {}'.format(
            outcome, clean(goal.container_path)
        ),
        OracleEvent.EXCEPTION: 'raised an exception',
        OracleEvent.UNREGISTERED_OUTCOME: 'returned {}, which is not one of its outcomes'.format(
            outcome or 'nothing'
        ),
        OracleEvent.TIME_LIMIT: 'ran over its time limit',
        ExpertQueryGoal.HELD_BACK: 'was not executed',
        OracleEvent.INTERRUPTED: 'ran when the program was stopped, or was about to begin',
    }.get(goal.failure_kind, 'failed')


def _jumps_to(event: Union[OracleEvent, Event]) -> str:
    """The state, or its path where it is in a container below."""
    try:
        data: Any = json.loads(event.data) if isinstance(event.data, str) else event.data
        return clean(str(data['to']))
    except (ValueError, KeyError, TypeError, RecursionError):
        return clean(event.target)


def next_step_words(event: Union[OracleEvent, Event]) -> str:
    """Return an event that follows an answer, as a sentence, or '' for events of other kinds."""
    state, outcome, target = clean(event.state), clean(event.outcome), clean(event.target)
    path = clean(event.path)
    return {
        OracleEvent.JUMP: 'The machine goes to {}.'.format(_jumps_to(event)),
        OracleEvent.SUPERSEDE: '{} counts as having ended with {}.'.format(state, outcome),
        OracleEvent.GIVE_UP: '{} gives up{}.'.format(path, _with(outcome)),
        OracleEvent.INTERFACE_START: 'Interface {} begins.'.format(target),
        OracleEvent.INTERFACE_END: 'Interface {} ended{}.'.format(target, _with(outcome)),
        OracleEvent.STATE_START: '{} runs.'.format(state),
        OracleEvent.WARNING: 'The robot warns: {}'.format(clean(event.text)),
        OracleEvent.TRIAL_END: 'The trial ended{}.'.format(_with(outcome)),
        OracleEvent.HEALTH_WAIT_START: 'The machine waits until the robot is well ({}).'.format(
            clean(event.text)
        ),
        OracleEvent.HEALTH_WAIT_END: '{}.'.format(clean(event.text[:1].upper() + event.text[1:])),
        OracleEvent.HOLD_START: '{} waits before {} ({}).'.format(
            path, state, clean(' by '.join(filter(None, (event.outcome, event.by))))
        ),
        OracleEvent.HOLD_END: '{} waits no longer before {}: {}.'.format(path, state, outcome),
        OracleEvent.SENT: '{} was sent to {} instead of {}{}.'.format(
            path, target, state, ' by ' + clean(event.by) if event.by else ''
        ),
    }.get(event.kind, '')


def event_words(event: Event) -> str:
    """Return any event as a sentence."""
    by = ' by ' + event.by if event.by else ''
    sentence = {
        EventKind.TRIAL_START: lambda: 'The trial of {} began.'.format(event.path),
        EventKind.RESUMED: lambda: 'The trial of {} goes on after its program was stopped.'.format(
            event.path
        ),
        EventKind.CONTAINER_START: lambda: '{} began in {}.'.format(event.path, event.state),
        EventKind.CONTAINER_END: lambda: '{} ended{}.'.format(event.path, _with(event.outcome)),
        EventKind.TRANSITION: lambda: '{} ended{}; next: {}.'.format(
            event.state, _with(event.outcome), event.target
        ),
        EventKind.FAILURE: lambda: '{} failed{}.'.format(event.state, _with(event.outcome)),
        EventKind.PRECONDITION_START: lambda: 'Precondition {} of {} is made to hold.'.format(
            event.target, event.state
        ),
        EventKind.PRECONDITION_END: lambda: 'Precondition {} of {}: {}.'.format(
            event.target, event.state, event.outcome
        ),
        EventKind.DECISION: lambda: _decision(event),
        EventKind.QUERY_OPENED: lambda: 'The expert is asked about {}.'.format(event.state),
        EventKind.QUERY_CLAIMED: lambda: 'The question was taken{}.'.format(by),
        EventKind.QUERY_RELEASED: lambda: 'The question was given back{}.'.format(by),
        EventKind.QUERY_ANSWERED: lambda: 'The question was answered{}: {}{}.'.format(
            by, event.outcome.replace('_', ' '), ' ' + event.target if event.target else ''
        ),
        EventKind.QUERY_EXPIRED: lambda: 'Nobody answered in time.',
        EventKind.QUERY_CANCELLED: lambda: 'The question was taken back.',
        EventKind.PREEMPT: lambda: '{} was asked to stop.'.format(event.path),
        EventKind.ANNOUNCE: lambda: '{} is about to be entered.'.format(event.state),
        EventKind.OPERATOR_COMMAND: lambda: 'Operator{}: {}. {}.'.format(
            ' ' + event.by if event.by else '',
            event.outcome.replace('_', ' '),
            clean(event.text[:1].upper() + event.text[1:]),
        ),
    }.get(event.kind)
    return sentence() if sentence else next_step_words(event)


def _decision(event: Event) -> str:
    """The sentence that the oracle made. Bags of 0.1 have none."""
    if event.text and DECIDED_BY in (event.data or {}):
        return clean(event.text) + '.'
    return 'The oracle decides: {}{}.'.format(
        event.outcome.replace('_', ' '), ' to ' + event.target if event.target else ''
    )


def _with(outcome: str) -> str:
    return ' with ' + outcome if outcome else ''


def _visible(character: str, lines: bool) -> str:
    if character == '\t' or character in '\n\u2028\u2029' and not lines:
        return ' '
    if character == '\n' or unicodedata.category(character)[0] != 'C':
        return character
    return '\ufffd'
