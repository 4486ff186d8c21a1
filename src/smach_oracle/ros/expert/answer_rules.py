"""Does an expert's decision fit the question? Pure: works on the fields of the messages alone."""

from typing import Dict

from smach_oracle.msg import ExpertDecision, ExpertQueryGoal
from smach_oracle.oracle.asking.answer_rules import (
    AnswerChoices,
    addressed,
    check_answer,
    check_output_keys,
    choices_of,
)
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.oracle.errors import AnswerError

from ..userdata_codec import UserdataCodecError, check

_KINDS = [int(kind) for kind in AnswerKind]


def check_decision(goal: ExpertQueryGoal, decision: ExpertDecision) -> None:
    """Check that a decision fits its question.

    :raises AnswerError: where it does not. The text says what would.
    """
    if not decision.by.strip():
        raise AnswerError('the answer does not say who gives it: `by` is empty')
    if decision.kind not in _KINDS:
        raise AnswerError(
            'decision kind {} is unknown; allowed: GOTO (1), SUPERSEDE (2), '
            'GIVE_UP (3), INTERFACE (4)'.format(decision.kind)
        )
    choices = choices_of(goal)
    check_answer(
        addressed(
            Answer(
                AnswerKind(decision.kind),
                decision.state,
                decision.outcome,
                decision.interface,
                container=decision.container,
            ),
            choices,
        ),
        choices,
    )
    _check_outputs(choices, decision)


def same_decision(one: ExpertDecision, other: ExpertDecision) -> bool:
    """Whether both ask the same of the robot, whoever gave them and why."""
    fields = ('kind', 'state', 'outcome', 'interface', 'container')
    return all(getattr(one, field) == getattr(other, field) for field in fields) and _items(
        one
    ) == _items(other)


def describe_decision(decision: ExpertDecision) -> str:
    """Return a decision in one line for people."""
    if decision.kind == ExpertDecision.GOTO:
        return 'go to {}'.format(_named(decision, decision.state))
    if decision.kind == ExpertDecision.SUPERSEDE:
        return 'supersede with {}'.format(decision.outcome)
    if decision.kind == ExpertDecision.GIVE_UP:
        return (
            'give up with {}'.format(_named(decision, decision.outcome))
            if decision.outcome
            else 'give up'
        )
    if decision.kind == ExpertDecision.INTERFACE:
        return 'run interface {}'.format(decision.interface)
    return 'no decision'


def _named(decision: ExpertDecision, name: str) -> str:
    return '{}/{}'.format(decision.container, name) if decision.container else name


def _check_outputs(choices: AnswerChoices, decision: ExpertDecision) -> None:
    check_output_keys(
        choices.failed_state, [item.key for item in decision.outputs], choices.output_keys
    )
    for item in decision.outputs:
        try:
            check(item)
        except UserdataCodecError as err:
            raise AnswerError('output {}'.format(err)) from err


def _items(decision: ExpertDecision) -> Dict[str, object]:
    return {
        item.key: (item.encoding, item.type, item.md5sum, bytes(item.value))
        for item in decision.outputs
    }
