"""What is done where nobody answers a question (`on_no_answer`)."""

from typing import TYPE_CHECKING, Optional

from ..asking.question import names
from ..machine.jump_path import JumpPath, jump_path_to, why_closed_on
from ..machine.places import place_named
from .verdict import Verdict

if TYPE_CHECKING:
    from .recovering import Recovering


def fall_back(recovering: 'Recovering') -> Verdict:
    """Do what is configured for a question that nobody answers."""
    why, node = recovering.why_no_answer, recovering.node
    if recovering.occasion.keeps:  # whatever is configured for other questions
        return recovering.keep(why)
    verb, target = node.settings.on_no_answer
    if verb == 'goto':
        way = _jump_path_back(recovering)
        problem = _why_not(recovering, way) or recovering.budget.take_recovery()
        if way is not None and not problem:
            recovering.record.fallbacks += 1
            return recovering.jump(way, why)
        recovering.warn('on_no_answer: cannot go to {!r}: {}; stopping'.format(target, problem))
    elif verb == 'give_up':
        if target in node.machine.get_registered_outcomes():
            return recovering.give_up(why, target)
        recovering.warn(
            'on_no_answer: {!r} is no outcome of this container; stopping'.format(target)
        )
    return recovering.give_up(why)


def fallback_in_words(recovering: 'Recovering') -> str:
    """Return what `fall_back` will do, for who is asked."""
    if recovering.occasion.keeps:
        return 'stop, and keep the trial for the next start'
    node = recovering.node
    verb, target = node.settings.on_no_answer
    if verb == 'goto' and not _why_not(recovering, _jump_path_back(recovering)):
        return 'go to {}'.format(target)
    if verb == 'give_up' and target in node.machine.get_registered_outcomes():
        return 'end with {}'.format(target)
    ending = recovering.natural_ending()
    if ending.error is not None:
        return 'stop with the error {}'.format(type(ending.error).__name__)
    return (
        'go on to {}'.format(ending.state)
        if ending.state
        else 'stop with {}'.format(ending.outcome)
    )


def fallback_in_short(recovering: 'Recovering') -> str:
    """Return what is configured, for the log."""
    if recovering.occasion.keeps:
        return 'the trial is kept'
    return ' '.join(recovering.node.settings.on_no_answer).strip()


def _jump_path_back(recovering: 'Recovering') -> Optional[JumpPath]:
    """Return the way to the place that `on_no_answer` names, None where there is none."""
    node = recovering.node
    place = place_named(node, node.settings.on_no_answer[1])
    return jump_path_to(node, place) if place is not None else None


def _why_not(recovering: 'Recovering', way: Optional[JumpPath]) -> str:
    """Return why `on_no_answer` cannot lead to a place, '' where it can.

    It has a cap, or a trial without experts might not end.
    """
    record, budget = recovering.record, recovering.budget
    if record.fallbacks >= max(1, record.settings.max_recoveries):
        return 'this trial has gone there {} times for {} already'.format(
            record.fallbacks, record.label
        )
    if way is None:
        return 'no such state; there are ' + names(recovering.node.labels())
    over = 'the trial is over then' if recovering.ends_budget else budget.why_over()
    return (
        why_closed_on(way)
        or recovering.deciding.why_repeats_on(way)
        or over
        or budget.why_no_recovery()
    )
