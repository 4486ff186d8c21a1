"""The course of a trial as text that people read, one line for each thing that happened."""

from typing import Callable, Dict, List, NamedTuple, Sequence, Union

from smach_oracle.oracle.records.events import Event, EventKind, FailureKind

MOST_LINES = 80
_FIRST_LINES = 20


class ProbedStep(NamedTuple):
    """The visits and faults of a state that the kit itself saw."""

    path: str  # PATH/LABEL below the top machine
    visit: int
    what: str  # entered, fault, stub, ended, raised
    text: str
    wall_time: float  # s since the epoch
    told: bool = False  # whether events tell the visits of this state too
    failing: bool = False  # whether it ended in an outcome that is named like a failure


TrialStep = Union[Event, ProbedStep]


def below_top(path: str) -> str:
    """Return a container path without the name of the top machine."""
    return path.partition('/')[2]


def place_of(event: Event) -> str:
    """Return the state of an event as PATH/LABEL below the top machine."""
    above = below_top(event.path)
    return '{}/{}'.format(above, event.state) if above and event.state else event.state or above


def jump_from(event: Event) -> str:
    """Return the failed state of a JUMP, which may be in a container below, as `place_of` does."""
    return below_top((event.data or {}).get('from', '')) or place_of(event)


def jump_to(event: Event) -> str:
    """Return where a JUMP leads, which may be in a container below, as `place_of` does."""
    return below_top((event.data or {}).get('to', '')) or place_of(
        event._replace(state=event.target)
    )


def lines_of(steps: Sequence[TrialStep]) -> List[str]:
    """Return the lines of a trial. Those in the middle are left out where there are very many."""
    begin = steps[0].wall_time if steps else 0.0
    told = [(step, _place(step), _text(steps, index)) for index, step in enumerate(steps)]
    width = min(30, max([len(place) for _, place, text in told if text] + [0]))
    lines = [
        '  {:7.2f} s  {}  {}'.format(step.wall_time - begin, place.ljust(width), text)
        for step, place, text in told
        if text
    ]
    if len(lines) <= MOST_LINES:
        return lines
    last = MOST_LINES - _FIRST_LINES
    left_out = '  ... {} lines left out ...'.format(len(lines) - MOST_LINES)
    return lines[:_FIRST_LINES] + [left_out] + lines[-last:]


def _place(step: TrialStep) -> str:
    return step.path if isinstance(step, ProbedStep) else place_of(step)


def _text(steps: Sequence[TrialStep], index: int) -> str:
    step = steps[index]
    if isinstance(step, ProbedStep):
        return _of_probe(steps, index, step)
    if step.kind is EventKind.TRANSITION and index and _fails(steps[index - 1], step):
        return ''  # the way to the oracle, which its failure has told
    if step.kind is EventKind.STATE_START:
        return '' if _ends_next(steps, index, place_of(step)) else 'is entered'
    if step.kind in _SILENT:
        return ''
    tell = _TEXTS.get(step.kind)
    return '{}: {}'.format(step.kind.name.lower(), step.text) if tell is None else tell(step)


def _fails(before: TrialStep, step: Event) -> bool:
    return (
        isinstance(before, Event)
        and before.kind is EventKind.FAILURE
        and (before.path, before.state) == (step.path, step.state)
    )


def _of_probe(steps: Sequence[TrialStep], index: int, step: ProbedStep) -> str:
    if step.what in ('fault', 'stub'):
        return '{}: {} (visit {})'.format(step.what, step.text, step.visit)
    if step.told:
        return ''
    if step.what == 'entered':
        return '' if _ends_next(steps, index, step.path) else 'is entered'
    return '{} {}'.format('ends in' if step.what == 'ended' else 'raises', step.text)


def _ends_next(steps: Sequence[TrialStep], index: int, path: str) -> bool:
    """Whether the next thing told after a state was entered is its end."""
    for step in steps[index + 1 :]:
        if isinstance(step, ProbedStep):
            if step.what in ('fault', 'stub') or step.told:
                continue
            return step.path == path and step.what in ('ended', 'raised')
        return place_of(step) == path and step.kind in (EventKind.TRANSITION, EventKind.FAILURE)
    return False


def _failure(event: Event) -> str:
    kind = FailureKind(event.failure_kind).name.lower().replace('_', ' ')
    what = ' {}'.format(event.outcome) if event.outcome else ''
    return 'FAILS: {}{}{}'.format(kind, what, _because(event.text))


def _because(text: str) -> str:
    """Return the last line of a text, which is that of a traceback, in brackets."""
    lines = [line for line in text.strip().splitlines() if line.strip()]
    return ' ({})'.format(lines[-1].strip()) if lines else ''


def _by(event: Event) -> str:
    return ' by {}'.format(event.by) if event.by else ''


def _trial_end(event: Event) -> str:
    return 'the trial ends{}{}'.format(
        ' in ' + event.outcome if event.outcome else '', _because(event.text)
    )


def _leads(event: Event) -> str:
    return 'ends in {} -> {}'.format(event.outcome or '(no outcome)', event.target)


# what follows them says it all
_SILENT = {
    EventKind.TRIAL_START,
    EventKind.CONTAINER_START,
    EventKind.CONTAINER_END,
    EventKind.PRECONDITION_START,
    EventKind.QUERY_CLAIMED,
    EventKind.QUERY_RELEASED,
}
_TEXTS: Dict[EventKind, Callable[[Event], str]] = {
    EventKind.TRIAL_END: _trial_end,
    EventKind.TRANSITION: _leads,
    EventKind.FAILURE: _failure,
    EventKind.PRECONDITION_END: lambda event: 'precondition {}: {}{}'.format(
        event.target, event.outcome, _because(event.text)
    ),
    EventKind.DECISION: lambda event: 'decision: {}'.format(event.text),
    EventKind.JUMP: lambda event: 'jump to {}{}'.format(
        (event.data or {}).get('to', event.target), _by(event)
    ),
    EventKind.QUERY_OPENED: lambda event: 'question: {}'.format(event.text),
    EventKind.QUERY_ANSWERED: lambda event: 'answer{}: {}'.format(
        _by(event), ' '.join((event.outcome, event.target)).strip()
    ),
    EventKind.QUERY_EXPIRED: lambda event: 'no answer: {}'.format(event.text),
    EventKind.QUERY_CANCELLED: lambda event: 'question taken back: {}'.format(event.text),
    EventKind.INTERFACE_START: lambda event: 'interface {} begins'.format(event.target),
    EventKind.INTERFACE_END: lambda event: 'interface {} ends: {}'.format(
        event.target, event.outcome or 'failed'
    ),
    EventKind.SUPERSEDE: lambda event: 'superseded with {}{} -> {}'.format(
        event.outcome, _by(event), event.target
    ),
    EventKind.GIVE_UP: lambda event: 'gives up{}: {}'.format(_by(event), event.text),
    EventKind.PREEMPT: lambda event: 'is preempted',
    EventKind.WARNING: lambda event: 'warning: {}'.format(event.text),
}
