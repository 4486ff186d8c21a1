"""doc/inside/executive_inside.md: the phases of each occasion, in machines that run."""

import os
import re
from typing import Dict, List

import pytest
from machines import Scripted, goto, supersede
from occasions import OCCASIONS, Options, of_b, told_of

from smach_oracle.oracle.machine.nesting import nodes_of
from smach_oracle.oracle.records.events import EventKind

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
NONE = '-'
KEEP = 'keep'


def table_of(first: str) -> Dict[str, Dict[str, str]]:
    """The table of the page whose first column has this heading, by the words in that column."""
    with open(os.path.join(ROOT, 'doc', 'inside', 'executive_inside.md'), encoding='utf-8') as page:
        found = re.search(
            r'^(\| {} \|.*\n)\|[-|]+\n((?:\|.*\n)+)'.format(first), page.read(), re.MULTILINE
        )
    assert found is not None

    def cells(line):
        return [cell.strip() for cell in line.strip().strip('|').split('|')]

    head = cells(found.group(1))
    rows = [dict(zip(head, cells(line))) for line in found.group(2).splitlines()]
    return {row[first]: row for row in rows}


PHASES = table_of('phase')
ROWS = table_of('occasion')
BEGINS = {
    row: told['at first'].replace(NONE, '').split() for row, told in table_of('counted').items()
}
COUNTED = table_of('counted')


def phases_of(row: str) -> List[str]:
    """The phases that run, in their order."""
    return [phase for phase in PHASES if ROWS[row][phase] != NONE]


def told_by(row: str, phase: str, column: str = 'no verdict') -> List[str]:
    """The events of a phase."""
    if ROWS[row][phase] == KEEP:
        return ['WARNING']
    return PHASES[phase][column].replace(NONE, '').split()


def test_the_page_has_each_occasion_and_each_phase():
    assert set(ROWS) == set(COUNTED) == set(OCCASIONS)
    assert {ROWS[row][phase] for row in ROWS for phase in PHASES} == {'yes', 'passes', KEEP, NONE}
    assert all(set(row) == {'occasion', *PHASES} for row in ROWS.values())


@pytest.mark.parametrize('row', sorted(ROWS))
def test_where_no_phase_has_a_verdict_those_of_the_page_run_in_its_order(row, tmp_path):
    occasion = OCCASIONS[row](tmp_path, Options())
    assert occasion.run() == BEGINS[row] + [
        kind for phase in phases_of(row) for kind in told_by(row, phase)
    ]
    tried = ' '.join(occasion.questions()[-1].tried)
    assert ('asks too' in tried) is ('escalate' in phases_of(row)), 'that tells no event'


@pytest.mark.parametrize('end', [ValueError('no grasp'), 'no outcome', None])
def test_whatever_the_state_fails_by_the_phases_are_the_same(end):
    occasion = of_b(Options(), Scripted(end), told_of(EventKind.FAILURE), {})
    assert occasion.run() == BEGINS['failed'] + [
        kind for phase in phases_of('failed') for kind in told_by('failed', phase)
    ]


def test_without_the_setting_no_level_above_is_heard(tmp_path):
    occasion = OCCASIONS['failed'](tmp_path, Options(escalate=False))
    occasion.run()
    assert occasion.questions()[-1].tried == ()


AWAY = goto('AWAY')
# what gives a phase a verdict, and the container that makes its jump, None where that tells none
VERDICTS = {
    'obey': (Options(closes=False), 'TOP'),
    'wait until well': (Options(guarded=False), None),
    'ask first': (Options(AWAY), 'own'),
    'decide': (Options(policy='retry'), 'own'),
    'escalate': (Options(above='retry'), 'TOP'),
    'ask': (Options(AWAY), 'own'),
}


def test_there_is_a_machine_in_which_each_phase_has_a_verdict():
    """All but the last one, which has one in any case."""
    assert [*VERDICTS, 'fall back'] == [*PHASES]


@pytest.mark.parametrize(
    'row, phase',
    [(row, phase) for row in sorted(ROWS) for phase in VERDICTS if ROWS[row][phase] == 'yes'],
)
def test_the_first_verdict_is_followed_and_no_later_phase_runs(row, phase, tmp_path):
    options, jumps = VERDICTS[phase]
    occasion = OCCASIONS[row](tmp_path, options)
    before = phases_of(row)[: phases_of(row).index(phase)]
    own = ['JUMP'] if jumps in ('own', occasion.path) else []
    assert (
        occasion.run()
        == BEGINS[row]
        + [kind for each in before for kind in told_by(row, each)]
        + told_by(row, phase, 'a verdict')
        + own
    )
    if jumps == 'TOP':
        assert occasion.machine.of(EventKind.JUMP)[-1].path == 'TOP'


@pytest.mark.parametrize('row', sorted(ROWS))
def test_the_visit_and_the_rate_are_as_the_page_says_before_a_question(row, tmp_path):
    occasion = OCCASIONS[row](tmp_path, Options())
    occasion.run()
    visits = [
        visit.result.name
        for visit in occasion.questions()[-1].history
        if visit.state == occasion.state
    ]
    assert visits == occasion.visits_before + COUNTED[row]['visit'].replace(NONE, '').split()
    learned = occasion.machine.rate(occasion.state).failures - occasion.failures_before
    assert {0: 'no', 1: 'yes'}[learned] == COUNTED[row]['learned']


@pytest.mark.parametrize('row', sorted(ROWS))
def test_once_superseded_it_is_one_visit_that_is_superseded_and_no_failure(row, tmp_path):
    outcome = 'done' if row == 'arrived from elsewhere' else 'ok'
    occasion = OCCASIONS[row](tmp_path, Options(supersede(outcome)))
    assert occasion.run()[-2:] == ['QUERY_ANSWERED', 'SUPERSEDE']
    (node,) = [each for each in nodes_of(occasion.machine.machine) if each.path == occasion.path]
    visits = [
        visit.result.name
        for visit in node.records.history.latest()
        if visit.state == occasion.state
    ]
    assert visits == occasion.visits_before + ['SUPERSEDED']
    assert occasion.machine.rate(occasion.state).failures == occasion.failures_before


# an occasion on which the machine is sent so, and the options for that
SENDERS = {
    'the policy': ('failed', Options(policy='retry')),
    'a level above': ('failed', Options(above='retry')),
    'the expert': ('failed', Options(AWAY)),
    '`on_no_answer`': ('failed', Options()),
    'the robot, well again': ('robot unwell', Options(guarded=False)),
}


@pytest.mark.parametrize('sender', sorted(SENDERS))
def test_a_jump_spends_what_the_page_says(sender, tmp_path):
    row, options = SENDERS[sender]
    occasion = OCCASIONS[row](tmp_path, options)
    occasion.run()
    budget = occasion.machine.machine._oracle.tree.spent()['budget']
    spent = [
        occasion.machine.rate('B').recoveries,
        occasion.machine.rate('WORK').recoveries,
        *budget[:2],
    ]
    assert spent == [
        int(table_of('sent by')[sender][column])
        for column in (
            'recoveries of the state',
            'of the level above',
            'of the budget',
            'questions of the budget',
        )
    ]


def test_the_page_says_what_each_jump_spends():
    assert set(table_of('sent by')) == set(SENDERS)
