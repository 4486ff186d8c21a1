"""What is done where nobody answers a question (`on_no_answer`)."""

from typing import Optional, cast

from ..asking.question import names
from ..machine.places import JumpPath, jump_path_to, place_named
from ..settings.settings import GROUPS
from .options import option_on, why_repeats
from .recovery import Recovery
from .verdict import JumpTo, Verdict


def fall_back(recovery: Recovery) -> Verdict:
    """Do what is configured for a question that nobody answers."""
    why, node = recovery.why_no_answer, recovery.node
    if recovery.stopped():
        return recovery.preempted()
    if recovery.occasion.keeps:  # whatever is configured for other questions
        return recovery.keep(why)
    verb, target = node.settings.on_no_answer
    if verb == 'goto':
        way = _jump_path_back(recovery)
        problem = _why_not(recovery, way) or recovery.take_recovery()
        if not problem:
            verdict = recovery.jump(cast('JumpPath', way), why)
            recovery.record.fallbacks += isinstance(verdict, JumpTo)
            return verdict
        _warn(recovery, 'cannot go to {!r}: {}; stopping'.format(target, problem))
    elif verb == 'give_up':
        if target in node.machine.get_registered_outcomes():
            return recovery.give_up(why, target)
        _warn(recovery, '{!r} is no outcome of this container; stopping'.format(target))
    return recovery.give_up(why)


def _warn(recovery: Recovery, text: str) -> None:
    recovery.warn('{}: {}'.format(GROUPS.key_of('on_no_answer'), text))


def fallback_in_words(recovery: Recovery) -> str:
    """Return what `fall_back` will do, for who is asked."""
    if recovery.failure.still_runs:
        return 'it runs on'
    if recovery.occasion.keeps:
        return 'stop, and keep the trial for the next start'
    node = recovery.node
    verb, target = node.settings.on_no_answer
    if verb == 'goto' and not _why_not(recovery, _jump_path_back(recovery)):
        return 'go to {}'.format(target)
    if verb == 'give_up' and target in node.machine.get_registered_outcomes():
        return 'end with {}'.format(target)
    ending = recovery.ending()
    if ending.error is not None:
        return 'stop with the error {}'.format(type(ending.error).__name__)
    return (
        'go on to {}'.format(ending.state)
        if ending.state
        else 'stop with {}'.format(ending.outcome)
    )


def fallback_in_short(recovery: Recovery) -> str:
    """Return what is configured, for the log."""
    if recovery.occasion.keeps:
        return 'the trial is kept'
    return ' '.join(recovery.node.settings.on_no_answer).strip()


def _jump_path_back(recovery: Recovery) -> Optional[JumpPath]:
    """Return the way to the place that `on_no_answer` names, None where there is none."""
    node = recovery.node
    return jump_path_to(node, place_named(node, node.settings.on_no_answer[1]))


def _why_not(recovery: Recovery, way: Optional[JumpPath]) -> str:
    """Return why `on_no_answer` cannot lead to a place, '' where it can.

    It has a cap, or a trial without experts might not end.
    """
    record, budget = recovery.record, recovery.budget
    if record.fallbacks >= max(1, record.settings.max_recoveries):
        return 'this trial has gone there {} times for {} already'.format(
            record.fallbacks, record.label
        )
    if way is None:
        return 'no such state; there are ' + names(recovery.node.labels())
    over = 'the trial is over then' if recovery.ends_budget else budget.why_over()
    option = option_on(recovery, way)
    return option.closed or why_repeats(recovery, option) or over or budget.why_no_recovery()
