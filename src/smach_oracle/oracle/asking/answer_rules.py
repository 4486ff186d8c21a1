"""Checks that an answer fits its question: one rule for executive, servers and interfaces. Pure."""

from typing import Callable, Dict, Iterable, List, Mapping, NamedTuple, Sequence, Tuple

from ..errors import AnswerError
from ..identity import is_hashable
from ..settings.failing_outcomes import name_text
from .question import Answer, AnswerKind, Question, names

Target = Tuple[str, str]  # path of a container, '' for that of the failed state; label in it


class AnswerChoices(NamedTuple):
    """The states, outcomes and interfaces that an answer may choose from."""

    container: str  # path
    failed_state: str
    states: Mapping[Target, str]  # why it cannot be entered now, '' where it can
    supersede_outcomes: Sequence[str]
    give_up_outcomes: Sequence[str]
    interfaces: Sequence[str]
    output_keys: Sequence[str]  # of the failed state
    give_up_above: Sequence[Tuple[str, str]] = ()  # path of a level above, and an outcome of it


def choices_of(question: Question) -> AnswerChoices:
    """Return what an answer to a question may choose from.

    The ExpertQuery goal that carries a question has the same fields.
    """
    return AnswerChoices(
        question.container_path,
        question.failed_state,
        {(choice.container, choice.state): choice.blocked for choice in question.choices},
        [choice.outcome for choice in question.supersede_outcomes],
        question.give_up_outcomes,
        [offer.name for offer in question.interfaces],
        question.output_keys,
        [(each.container, each.outcome) for each in question.give_up_above],
    )


def checked_type(given: object) -> Answer:
    """Return what an expert's port has given, where it is an answer and its fields can be read.

    :raises AnswerError: where it is not. The text says which type is wrong.
    """
    if not isinstance(given, Answer):
        raise AnswerError('it is {}, not an Answer'.format(_type_of(given)))
    if not isinstance(given.kind, AnswerKind):
        raise AnswerError('kind is {}, not an AnswerKind'.format(_type_of(given.kind)))
    for name in ('state', 'outcome', 'interface'):
        if not is_hashable(getattr(given, name)):
            raise AnswerError('{} is {}, not a name'.format(name, _type_of(getattr(given, name))))
    for name in ('by', 'why', 'container'):
        if not isinstance(getattr(given, name), str):
            raise AnswerError('{} is {}, not text'.format(name, _type_of(getattr(given, name))))
    if given.outputs is not None and not isinstance(given.outputs, Mapping):
        raise AnswerError('outputs is {}, not a mapping'.format(_type_of(given.outputs)))
    return given


def _type_of(value: object) -> str:
    return 'of type ' + type(value).__name__


def addressed(answer: Answer, choices: AnswerChoices) -> Answer:
    """Return an answer with the container of what it names, and the outcome itself.

    A state that the container of the failed state has not, and one other has, is that one's.
    An outcome that is not text is answered by its text.
    """
    for outcome in _outcomes_for(answer, choices):
        if name_text(outcome) == answer.outcome:
            answer = answer._replace(outcome=outcome)
    is_beside = (answer.container, answer.state) in choices.states  # another branch
    if answer.container == choices.container and not is_beside:
        return answer._replace(container='')
    if answer.container or answer.kind is not AnswerKind.GOTO:
        return answer
    found = [path for path, label in choices.states if label == answer.state]
    return answer._replace(container=found[0]) if len(found) == 1 else answer


def _outcomes_for(answer: Answer, choices: AnswerChoices) -> Sequence[str]:
    """Return the outcomes of which an answer may name one."""
    if answer.kind is AnswerKind.SUPERSEDE:
        return choices.supersede_outcomes
    if answer.container in ('', choices.container):
        return choices.give_up_outcomes
    return [outcome for path, outcome in choices.give_up_above if path == answer.container]


def check_answer(answer: Answer, choices: AnswerChoices) -> None:
    """Check an answer that is `addressed`, and the keys of its outputs.

    :raises AnswerError: where it does not fit. The text says what would.
    """
    _CHECKS[answer.kind](answer, choices)
    check_output_keys(choices.failed_state, answer.outputs or (), choices.output_keys)


def _refuse(what: str, allowed: Iterable[object], more: str = '') -> None:
    raise AnswerError('{}; allowed: {}{}'.format(what, names(allowed), more))


def check_output_keys(state: str, keys: Iterable[str], allowed: Sequence[str]) -> None:
    """Check that outputs go to output keys of a state, to each once at most.

    :raises AnswerError: where they do not.
    """
    given: List[str] = list(keys)
    unknown = [key for key in given if key not in allowed]
    if unknown:
        _refuse('{} has no output keys {}'.format(state, names(unknown)), allowed)
    if len(set(given)) < len(given):
        raise AnswerError(
            'output keys come twice: {}'.format(
                names({key for key in given if given.count(key) > 1})
            )
        )


def check_outcome(state: str, outcome: str, allowed: Sequence[str]) -> None:
    """Check that a state may be superseded with an outcome.

    :raises AnswerError: where it may not.
    """
    if outcome not in allowed:
        _refuse('{} has no outcome {!r} to supersede it with'.format(state, outcome), allowed)


def _check_goto(answer: Answer, choices: AnswerChoices) -> None:
    container = answer.container
    target = (container, answer.state)
    free = [
        label
        for (path, label), blocked in choices.states.items()
        if path == container and not blocked
    ]
    if target not in choices.states:
        elsewhere = [path for path, label in choices.states if label == answer.state]
        _refuse(
            '{} has no state {!r} to go to'.format(container or choices.container, answer.state),
            free,
            '; it is in {}: name the container'.format(names(elsewhere)) if elsewhere else '',
        )
    if choices.states[target]:
        _refuse('{} cannot be entered now: {}'.format(answer.state, choices.states[target]), free)


def _check_supersede(answer: Answer, choices: AnswerChoices) -> None:
    check_outcome(choices.failed_state, answer.outcome, choices.supersede_outcomes)


def _check_give_up(answer: Answer, choices: AnswerChoices) -> None:
    container = answer.container or choices.container
    allowed = _outcomes_for(answer, choices)
    more = '' if answer.container else ', or none at all'
    if answer.outcome not in allowed and (answer.outcome or answer.container):
        _refuse(
            '{} has no outcome {!r} to give up with'.format(container, answer.outcome),
            allowed,
            more,
        )


def _check_interface(answer: Answer, choices: AnswerChoices) -> None:
    if answer.interface not in choices.interfaces:
        _refuse(
            'no interface {!r} is on offer for {}'.format(answer.interface, choices.failed_state),
            choices.interfaces,
        )


_CHECKS: Dict[AnswerKind, Callable[[Answer, AnswerChoices], None]] = {
    AnswerKind.GOTO: _check_goto,
    AnswerKind.SUPERSEDE: _check_supersede,
    AnswerKind.GIVE_UP: _check_give_up,
    AnswerKind.INTERFACE: _check_interface,
}
