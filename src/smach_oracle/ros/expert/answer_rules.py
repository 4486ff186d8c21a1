"""Does an expert's decision fit the question? Pure: works on the fields of the messages alone."""
from typing import Callable, Dict, Iterable

from smach_oracle.msg import ExpertDecision, ExpertQueryGoal, UserdataItem

from ..oracle.errors import AnswerError
from ..oracle.question import names
from .userdata_codec import UserdataCodecError, decode


def check_decision(goal: ExpertQueryGoal, decision: ExpertDecision) -> None:
    """Return where the decision fits the question.

    :raises AnswerError: where it does not; the text says what would.
    """
    if not decision.by.strip():
        raise AnswerError('the answer does not say who gives it: `by` is empty')
    check = _CHECKS.get(decision.kind)
    if check is None:
        raise AnswerError('decision kind {} is unknown; allowed: GOTO (1), SUPERSEDE (2), GIVE_UP (3), INTERFACE (4)'
                          .format(decision.kind))
    check(goal, decision)
    _check_outputs(goal, decision)


def same_decision(one: ExpertDecision, other: ExpertDecision) -> bool:
    """Whether both ask the same of the robot, whoever gave them and why."""
    return all(getattr(one, field) == getattr(other, field) for field in ('kind', 'state', 'outcome', 'interface')) \
        and _items(one) == _items(other)


def describe_decision(decision: ExpertDecision) -> str:
    """One line for people."""
    if decision.kind == ExpertDecision.GOTO:
        return 'go to {}'.format(decision.state)
    if decision.kind == ExpertDecision.SUPERSEDE:
        return 'supersede with {}'.format(decision.outcome)
    if decision.kind == ExpertDecision.GIVE_UP:
        return 'give up with {}'.format(decision.outcome) if decision.outcome else 'give up'
    if decision.kind == ExpertDecision.INTERFACE:
        return 'run interface {}'.format(decision.interface)
    return 'no decision'


def _check_goto(goal: ExpertQueryGoal, decision: ExpertDecision) -> None:
    choices = {choice.state: choice for choice in goal.choices}
    free = [choice.state for choice in goal.choices if not choice.blocked]
    if decision.state not in choices:
        raise AnswerError('{} has no state {!r} to go to; allowed: {}'.format(
            goal.container_path, decision.state, names(free)))
    if choices[decision.state].blocked:
        raise AnswerError('{} cannot be entered now: {}; allowed: {}'.format(
            decision.state, choices[decision.state].blocked, names(free)))


def _check_supersede(goal: ExpertQueryGoal, decision: ExpertDecision) -> None:
    allowed = [choice.outcome for choice in goal.supersede_outcomes]
    if decision.outcome not in allowed:
        raise AnswerError('{} has no outcome {!r} to supersede it with; allowed: {}'.format(
            goal.failed_state, decision.outcome, names(allowed)))


def _check_give_up(goal: ExpertQueryGoal, decision: ExpertDecision) -> None:
    if decision.outcome and decision.outcome not in goal.give_up_outcomes:
        raise AnswerError('{} has no outcome {!r} to give up with; allowed: {}, or none at all'
                          .format(goal.container_path, decision.outcome, names(goal.give_up_outcomes)))


def _check_interface(goal: ExpertQueryGoal, decision: ExpertDecision) -> None:
    allowed = [offer.name for offer in goal.interfaces]
    if decision.interface not in allowed:
        raise AnswerError('no interface {!r} is on offer for {}; allowed: {}'.format(
            decision.interface, goal.failed_state, names(allowed)))


_CHECKS: Dict[int, Callable[[ExpertQueryGoal, ExpertDecision], None]] = {
    ExpertDecision.GOTO: _check_goto,
    ExpertDecision.SUPERSEDE: _check_supersede,
    ExpertDecision.GIVE_UP: _check_give_up,
    ExpertDecision.INTERFACE: _check_interface,
}


def _check_outputs(goal: ExpertQueryGoal, decision: ExpertDecision) -> None:
    keys = [item.key for item in decision.outputs]
    unknown = [key for key in keys if key not in goal.output_keys]
    if unknown:
        raise AnswerError('{} has no output keys {}; allowed: {}'.format(
            goal.failed_state, names(unknown), names(goal.output_keys)))
    if len(set(keys)) < len(keys):
        raise AnswerError('output keys come twice: {}'.format(names({key for key in keys if keys.count(key) > 1})))
    _check_values(decision.outputs)


def _check_values(items: Iterable[UserdataItem]) -> None:
    """Messages are left to the robot: a shared server need not have every robot's types."""
    for item in items:
        if item.encoding not in (UserdataItem.ROS_MESSAGE, UserdataItem.ROS_MESSAGES):
            try:
                decode(item)
            except UserdataCodecError as err:
                raise AnswerError('output {}'.format(err)) from err


def _items(decision: ExpertDecision) -> Dict[str, object]:
    return {item.key: (item.encoding, item.type, item.md5sum, bytes(item.value)) for item in decision.outputs}
