"""Questions as rich renderables, from their messages. Pure.

Everything that a robot has sent goes through `clean` into Text objects, never through markup.
"""

import math
from typing import Iterable, List, Sequence

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from smach_oracle.msg import (
    ExpertDecision,
    ExpertQueryGoal,
    OpenQuery,
    StateChoice,
    UserdataItem,
    VisitedState,
)
from smach_oracle.oracle.records.short_text import shortened

from ..followed_server import ListedQuestion
from ..wording import clean, failure_words, still_runs
from .options import AnswerOption, is_wait_on, options
from .text import CLASS_NAMES, duration, rate_bar, rate_colour

_VISITS = {
    VisitedState.SUCCESS: ('✓', '#2e9e3f'),
    VisitedState.FAILURE: ('✗', '#cc3333'),
    VisitedState.SUPERSEDED: ('☞', '#3b7dd8'),
    VisitedState.PREEMPTED: ('⏹', 'dim'),
}
_SHOWN_VISITS = 12
_SHOWN_LINES = 12
_FIRST_LINES = 3
_LONGEST_LINE = 1000  # letters


def question(goal: ExpertQueryGoal, age_s: float = 0.0) -> RenderableType:
    """Return the whole question: the failure, its history, and everything that may be answered."""
    parts: List[RenderableType] = [_failure(goal, age_s)]
    if goal.history:
        parts += [_heading('History'), history(goal.history)]
    found = options(goal)
    parts += [_heading('Go to'), _states(goal, found)]
    if still_runs(goal):
        parts.append(
            Text(
                '{} is preempted by every answer but to wait on'.format(clean(goal.failed_state)),
                'dim',
            )
        )
    if goal.supersede_outcomes:
        parts += [
            _heading('Supersede {} (you did its work)'.format(clean(goal.failed_state))),
            _supersede(goal, found),
        ]
    parts += [_heading('Give up'), _give_up(goal, found)]
    if goal.interfaces:
        parts += [_heading('Shared-autonomy interfaces'), _interfaces(goal, found)]
    if goal.userdata:
        parts += [_heading('Userdata'), _userdata(goal.userdata)]
    return Group(*parts)


def overview(listed: Sequence[ListedQuestion], now_s: float) -> Table:
    """Return the open questions of all servers, numbered from 1."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, expand=True)
    table.add_column('', style='bold cyan', no_wrap=True)
    for title in ('robot', 'failed state', 'rate', 'waits', 'left', 'who'):
        table.add_column(title, overflow='fold')
    for number, each in enumerate(listed, 1):
        left = '' if each.deadline_s == math.inf else duration(each.deadline_s - now_s)
        table.add_row(
            str(number),
            Text(clean(each.goal.robot)),
            _place(each.goal),
            Text('{:.0f}%'.format(100 * each.goal.rate), rate_colour(each.goal.rate)),
            duration(now_s - each.asked_s),
            left,
            Text(_holder(each)),
        )
    return table


def history(visits: Sequence[VisitedState]) -> Text:
    """Return the chain of visited states, latest last. The oldest are left out of a long one."""
    text = Text('… → ' if len(visits) > _SHOWN_VISITS else '', 'dim')
    for index, visit in enumerate(visits[-_SHOWN_VISITS:]):
        sign, style = _VISITS.get(visit.result, ('?', ''))
        text.append(' → ' if index else '', 'dim')
        text.append(clean(visit.state) + sign, style)  # one word: the sign stays with its state
        if visit.result == VisitedState.FAILURE and visit.outcome:
            text.append(' ' + clean(visit.outcome), 'dim')
    return text


def _failure(goal: ExpertQueryGoal, age_s: float) -> Panel:
    lines: List[RenderableType] = [
        Text.assemble((clean(goal.failed_state), 'bold'), ' ' + failure_words(goal))
    ]
    if goal.text:
        lines.append(Text(_without_middle(goal.text), 'italic'))
    facts = Text.assemble(
        'failure rate ',
        rate_bar(goal.rate),
        ' ',
        (CLASS_NAMES.get(goal.failure_class, '?'), 'bold ' + rate_colour(goal.rate)),
    )
    if goal.continuous:
        facts.append(' · continuous', 'bold')
    facts.append(
        ' · {} {} so far'.format(
            goal.recoveries, 'recovery' if goal.recoveries == 1 else 'recoveries'
        )
    )
    lines.append(facts)
    if not still_runs(goal):  # there the text says it
        lines.append(Text('asked because ' + clean(goal.reason)))
    if goal.tried:
        lines.append(Text('tried: ' + ', '.join(clean(step) for step in goal.tried)))
    if goal.deadline > 0:
        lines.append(
            Text('unanswered: {}'.format(clean(goal.fallback) or 'the fallback happens'), 'dim')
        )
    title = Text.assemble(
        (clean(goal.robot), 'bold'), ' asks about ', (clean(goal.container_path), 'bold')
    )
    return Panel(
        Group(*lines),
        title=title,
        title_align='left',
        border_style=rate_colour(goal.rate),
        padding=(0, 1),
        subtitle=Text('asked {} ago'.format(duration(age_s))),
        subtitle_align='right',
    )


def _states(goal: ExpertQueryGoal, found: Iterable[AnswerOption]) -> Table:
    keys = {
        (option.container, option.name): option.key
        for option in found
        if option.kind == ExpertDecision.GOTO
    }
    table = _table('', 'state', 'success', 'class', 'visits', 'on arrival')
    for choice in goal.choices:
        dim = 'dim' if choice.blocked else ''
        success = choice.helped / choice.tried if choice.tried else choice.predicted_success
        rate = 1.0 - success
        bar = rate_bar(success, 6)
        bar.stylize(dim or rate_colour(rate))  # the colour is that of its failure rate
        name = Text(clean(choice.state), dim or 'bold')
        if choice.container:
            name = Text.assemble((clean(choice.container) + '/', 'dim'), name)
        if is_wait_on(goal, choice):
            name = Text.assemble(('wait on', 'bold green'), ' (', name, ' runs on)')
        table.add_row(
            keys[choice.container, choice.state],
            name,
            bar,
            Text(CLASS_NAMES.get(choice.failure_class, '?'), dim or rate_colour(rate)),
            str(choice.visits),
            _arrival(choice),
        )
    return table


def _arrival(choice: StateChoice) -> Text:
    """Return what is to be expected of a choice, and what speaks against it."""
    parts = []
    if choice.recommended:
        parts.append(Text('recommended', 'bold green'))
    if choice.tried:
        took = ', {}'.format(duration(choice.helped_s)) if choice.helped else ''
        told = 'led on {} of {} times from here{}'.format(choice.helped, choice.tried, took)
        parts.append(Text(told, 'green' if 2 * choice.helped > choice.tried else ''))
    if choice.blocked:
        parts.append(Text('blocked: ' + clean(choice.blocked), 'bold #cc3333'))
    if choice.repeats:
        parts.append(Text('repeats: ' + _list(choice.repeats), 'bold #c77700'))
    if choice.runs_again:
        parts.append(Text('runs again: ' + _list(choice.runs_again), '#c77700'))
    if choice.missing_keys:
        parts.append(Text('missing: ' + _list(choice.missing_keys), 'bold #c77700'))
    if choice.preconditions:
        parts.append(Text('preconditions: ' + _list(choice.preconditions), 'dim'))
    return Text('\n').join(parts)


def _supersede(goal: ExpertQueryGoal, found: Iterable[AnswerOption]) -> RenderableType:
    table = _table('', 'outcome', 'leads to')
    targets = {choice.outcome: choice.target for choice in goal.supersede_outcomes}
    for option in found:
        if option.kind == ExpertDecision.SUPERSEDE:
            table.add_row(
                option.key,
                Text(clean(option.name), 'bold'),
                Text('→ ' + clean(targets[option.name])),
            )
    if not goal.output_keys:
        return table
    return Group(table, Text('with output userdata: ' + _list(goal.output_keys), 'dim'))


def _give_up(goal: ExpertQueryGoal, found: Iterable[AnswerOption]) -> Table:
    table = _table('', 'outcome', header=False)
    for option in found:
        if option.kind == ExpertDecision.GIVE_UP:
            table.add_row(
                option.key,
                Text(clean(option.name), 'bold')
                if option.name
                else Text(
                    'end as {} failure would have ended {}'.format(
                        'a' if still_runs(goal) else 'the', clean(goal.container_path)
                    )
                ),
            )
    return table


def _interfaces(goal: ExpertQueryGoal, found: Iterable[AnswerOption]) -> Table:
    table = _table('', 'name', 'description', header=False)
    described = {offer.name: offer.description for offer in goal.interfaces}
    for option in found:
        if option.kind == ExpertDecision.INTERFACE:
            table.add_row(
                option.key, Text(clean(option.name), 'bold'), Text(clean(described[option.name]))
            )
    return table


def _userdata(items: Sequence[UserdataItem]) -> Table:
    table = _table('key', 'value', header=False)
    for item in items:
        table.add_row(Text(clean(item.key), 'bold'), _value(item))
    return table


def _value(item: UserdataItem) -> Text:
    if item.encoding == UserdataItem.JSON:
        text = clean(bytes(item.value).decode('utf-8', 'replace'))
        return Text(shortened(text, 200))
    if item.encoding == UserdataItem.UNSENT:
        return Text('({}, not sent)'.format(clean(item.type)), 'dim')
    return Text(
        '({}{})'.format(
            clean(item.type), '[]' if item.encoding == UserdataItem.ROS_MESSAGES else ''
        ),
        'dim',
    )


def _place(goal: ExpertQueryGoal) -> Text:
    return Text.assemble(
        (clean(goal.container_path) + '/', 'dim'), (clean(goal.failed_state), 'bold')
    )


def _holder(each: ListedQuestion) -> str:
    if each.status == OpenQuery.INTERFACE_RUNNING:
        return 'interface ' + clean(each.goal.interface)
    return clean(each.holder)


def _table(*titles: str, header: bool = True) -> Table:
    table = Table(
        box=None, pad_edge=False, show_header=header, header_style='dim', padding=(0, 2, 0, 0)
    )
    for index, title in enumerate(titles):
        key = index == 0 and not title
        table.add_column(
            title,
            style='bold cyan' if key else '',
            no_wrap=key,
            min_width=2 if key else None,
            overflow='fold',
        )
    return table


def _heading(text: str) -> Text:
    return Text('\n' + text, 'bold underline')


def _list(items: Iterable[str]) -> str:
    return ', '.join(clean(item) for item in items)


def _without_middle(text: str) -> str:
    """A long text without its middle: of a traceback the call, and what was raised and why."""
    lines = [shortened(line, _LONGEST_LINE) for line in clean(text.strip(), lines=True).split('\n')]
    if len(lines) <= _SHOWN_LINES:
        return '\n'.join(lines)
    tail = _SHOWN_LINES - _FIRST_LINES
    return '\n'.join([*lines[:_FIRST_LINES], '…', *lines[-tail:]])
