"""The report of `oracle_run --check` on a machine, as text for people, 100 columns wide."""

import textwrap
from collections import Counter
from dataclasses import fields
from typing import Any, Iterator, List, Sequence, Tuple

import smach
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.decision.policy import Action
from smach_oracle.oracle.decision.ways import WAITS_S, WayKind
from smach_oracle.oracle.prospects import (
    ContainerProspect,
    OutcomeProspect,
    StateProspect,
)
from smach_oracle.oracle.settings.settings import GROUPS, Settings, StateSettings

from .setting_words import in_words

WIDTH = 100
_IN_WORDS = {
    Action.REVISIT: 'retry',
    Action.STEP_BACK: 'step back',
    Action.RESTART: 'start over',
    Action.ASK: 'ask',
    Action.GIVE_UP: 'give up',
}
_WAYS = {
    WayKind.AGAIN: 'again',
    WayKind.WAIT: 'after {}'.format(' or '.join('{:g} s'.format(each) for each in WAITS_S)),
    WayKind.PREPARE: 'after its preconditions',
    WayKind.STEP_BACK: 'from 1, 2, 4... states back',
    WayKind.START: 'from the start',
    WayKind.TOP: 'from the start of the top machine',
}
# told by lines of their own
_TOLD = ('preconditions', 'time_limit_s')
_PARTS = ('defaults', 'states', 'interfaces', 'policy_parameters')


def lines_of(container: ContainerProspect) -> List[str]:
    """Return the text about one container and its states."""
    usual = _usual_actions(container)
    lines = _heading(container)
    if container.recovers:
        lines += _entry('on a failure', usual, 2)
    for state in container.states:
        lines += [''] + list(_state(container, state, usual))
    return lines


def wrapped(text: str, indent: int, hanging: int = 0) -> List[str]:
    """Break a paragraph into lines.

    `indent`: columns before it. `hanging`: more before all lines but the first.
    """
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=' ' * indent,
        subsequent_indent=' ' * (indent + hanging),
        break_on_hyphens=False,
    ) or ['']


def _heading(container: ContainerProspect) -> List[str]:
    settings = container.settings
    title = '{} begins at {}; ends in {}'.format(
        container.path, container.initial or '(no state)', ', '.join(map(str, container.outcomes))
    )
    lines = wrapped(title, 0, 4)
    lines += _entry('other ends', _unknown_ends(container), 2)
    if not container.recovers:
        return lines + wrapped('The oracle recovers nothing here: it observes.', 2)
    if not container.is_top and settings.escalate:
        lines += wrapped('Before it asks, the oracle of the machine around it may decide.', 2)
    back = (
        'each state is on its own, so that a step back is a retry'
        if container.has_branches
        else 'a step back leads to an earlier state, to {} where none has succeeded'.format(
            'what ran before it in the machine around it, or to ' + container.initial
            if settings.step_back_across and not container.is_top
            else container.initial
        )
    )
    if POLICIES[settings.policy].goes_by_ways:
        back = 'some ways, each once, and then a person (doc/ways.md)'
    lines += _entry('policy', '{}; {}'.format(_policy(settings), back), 2)
    lines += _entry('not repeated', _not_repeated(container), 2)
    lines += _entry('asking', _asking(settings), 2)
    lines += _entry(
        'set',
        ', '.join(
            _changed(settings, Settings(), _PARTS)
            + _changed(settings.defaults, StateSettings(), ())
        ),
        2,
    )
    return lines


def _unknown_ends(container: ContainerProspect) -> str:
    """Name the ends whose names say neither success nor failure, and what settles it."""
    if not container.unknown_ends:
        return ''
    if not container.is_top:
        return (
            '{}: a failure leads here, and the machine around it takes it as no failure, since the '
            'name does not say it'.format(', '.join(container.unknown_ends))
        )
    return (
        '{}: nothing says whether this is a success or a failure. A trial that ends so counts as '
        '"other end". To settle it, list all failing ends in failing_outcomes (the others are then '
        'successes), or choose a name that says it, such as {}_succeeded'
    ).format(', '.join(container.unknown_ends), container.unknown_ends[0])


def _policy(settings: Settings) -> str:
    parameters = ', '.join(
        '{} {:g}'.format(*each) for each in sorted(settings.policy_parameters.items())
    )
    return '{} ({})'.format(settings.policy, parameters) if parameters else settings.policy


def _not_repeated(container: ContainerProspect) -> str:
    if not container.guarded:
        return ''
    return '{}: where a retry or a step back would do so, the oracle {}'.format(
        ', '.join(container.guarded),
        'asks' if POLICIES[container.settings.policy].asks else 'gives up',
    )


def _asking(settings: Settings) -> str:
    if not POLICIES[settings.policy].asks:
        return 'nobody: the policy gives up where others ask'
    fallback = ' '.join(settings.on_no_answer).strip()
    if not settings.deadline_s:
        return 'an expert, without end'
    return 'an expert; without an answer in {:g} s, or without an expert: {}'.format(
        settings.deadline_s, fallback
    )


def _state(container: ContainerProspect, state: StateProspect, usual: str) -> Iterator[str]:
    yield from wrapped('{} ({})'.format(state.label, _kind(state.state)), 2, 4)
    yield from _outcome_lines(container, state)
    if not container.recovers:
        return
    settings, actions = state.settings, _actions(container, state)
    yield from _entry('on a failure', actions if actions != usual else '', 4)
    if Action.STEP_BACK in {action for _, some in state.actions for action in some}:
        yield from _entry('may run again', _before(state), 4)
    yield from _entry('preconditions', ', '.join(spec.name for spec in settings.preconditions), 4)
    if settings.time_limit_s is not None:
        yield from _entry('time limit', '{:g} s'.format(settings.time_limit_s), 4)
    yield from _entry('interfaces', ', '.join(offer.name for offer in state.offers), 4)
    yield from _entry('set', ', '.join(_changed(settings, container.settings.defaults, _TOLD)), 4)


def _before(state: StateProspect) -> str:
    """Say which states a step back may run again, and which ones it does not go to."""
    told = ', '.join(state.before)
    if not state.not_before:
        return told
    return '{}; it does not go back to {}, since that may repeat what on_retry protects'.format(
        told or 'nothing', ', '.join(state.not_before)
    )


def _kind(state: smach.State) -> str:
    name = type(state).__name__
    if not isinstance(state, smach.Container) or isinstance(state, smach.StateMachine):
        return name
    try:
        inside = ', '.join(str(label) for label in state.get_children())
    except (AttributeError, TypeError):  # an Iterator that has no contained state yet
        inside = ''
    return '{} of {}'.format(name, inside or 'nothing')


def _outcome_lines(container: ContainerProspect, state: StateProspect) -> Iterator[str]:
    rows = [
        (str(each.outcome), _target(each), _meaning(container, each)) for each in state.outcomes
    ]
    for line in _aligned(rows):
        yield from wrapped(line, 4, 4)


def _target(outcome: OutcomeProspect) -> str:
    route = outcome.route
    if not route.target:
        return 'leads nowhere'
    return 'to {}'.format(route.target) if route.is_state else 'ends in {}'.format(route.target)


def _meaning(container: ContainerProspect, outcome: OutcomeProspect) -> str:
    if not outcome.is_failure:
        return ''
    if not container.recovers:
        return 'failure'
    if outcome.author_recovers:
        return "failure, the author's own way is kept"
    unless = ' unless child_termination_cb stops others' if outcome.may_stop_others else ''
    return 'failure, the oracle takes it up' + unless


def _aligned(rows: Sequence[Tuple[str, ...]]) -> List[str]:
    if not rows:
        return []
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    # a long name must not push all others out of sight
    return [
        '  '.join(cell.ljust(min(width, 32)) for cell, width in zip(row, widths)).rstrip()
        for row in rows
    ]


def _usual_actions(container: ContainerProspect) -> str:
    """Say what the policy may do when a state fails, for most of the states."""
    counts = Counter(_actions(container, state) for state in container.states)
    return counts.most_common(1)[0][0] if counts else ''


def _actions(container: ContainerProspect, state: StateProspect) -> str:
    """Say what the policy may do, by failure rate."""
    settings = state.settings
    every = {actions for _, actions in state.actions}
    if every in ({(Action.ASK,)}, {(Action.GIVE_UP,)}):
        return _IN_WORDS[every.pop()[0]]
    if state.kinds:
        return _menu(container, state)
    last = 'ask' if POLICIES[container.settings.policy].asks else 'give up'
    if len(every) == 1:
        return '{}; after {} recoveries: {}'.format(
            _either(every.pop()), settings.max_recoveries, last
        )
    limits = {
        FailureClass.LOW: 'rate below {:g}'.format(settings.moderate_from),
        FailureClass.MODERATE: '{:g} to {:g}'.format(settings.moderate_from, settings.high_from),
        FailureClass.HIGH: 'from {:g}'.format(settings.high_from),
    }
    told = '; '.join(
        '{}: {}'.format(limits[failure_class], _either(actions))
        for failure_class, actions in state.actions
    )
    return '{}; after {} recoveries: {}'.format(told, settings.max_recoveries, last)


def _menu(container: ContainerProspect, state: StateProspect) -> str:
    """Say which ways a policy may go that goes by ways, and how many of them."""
    policy, allowed = POLICIES[container.settings.policy], state.settings.max_recoveries
    most, of_trial = policy.most_of_streak, policy.most_of_trial
    told = '{}, of: {}; after {} in a row'.format(
        'each once' if policy.draws else 'the one first that costs least for its hope',
        ', '.join(_WAYS[kind] for kind in state.kinds),
        most,
    )
    if most is not None and allowed < most:
        told += ' (max_recoveries cuts them to {})'.format(allowed)
    return told + ', {} in a trial, or where none costs less than to ask: ask'.format(of_trial)


def _either(actions: Sequence[Action]) -> str:
    return ' or '.join(_IN_WORDS[action] for action in actions)


def _changed(settings: Any, others: Any, left_out: Sequence[str]) -> List[str]:
    """The fields in which settings differ from others, as "memory 5"."""
    return [
        '{} {}'.format(GROUPS.key_of(each.name), in_words(getattr(settings, each.name)))
        for each in fields(settings)
        if each.name not in left_out and getattr(settings, each.name) != getattr(others, each.name)
    ]


def _entry(name: str, text: str, indent: int) -> List[str]:
    """A line with a name before it. None where there is nothing to say."""
    if not text:
        return []
    return wrapped('{:<14}{}'.format(name, text), indent, 14)
