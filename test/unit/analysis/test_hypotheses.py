"""The verdicts on the hypotheses of the fifth freeze, from rows."""

import json

import pytest

from smach_oracle.analysis import comparison
from smach_oracle.analysis.judging import hypotheses
from smach_oracle.analysis.judging.account import account_in, account_of, account_text
from smach_oracle.analysis.judging.hypotheses import (
    BARE,
    DEFAULT,
    LEARNED,
    MENU,
    RANDOM,
    RESTART,
    WORLDS,
    cost_of,
    harmed_unasked,
    verdicts,
)
from smach_oracle.analysis.trial_rows import TrialRow, append_rows
from smach_oracle.oracle.records.events import Event, EventKind

FAILING = 60  # of so many trials, the first of each variant
PAIRS = 400


def trial(world, variant, seed, **more):
    told = dict(true_success=True, sim_s=60.0, expert_s=0.0, damage=0)
    return TrialRow(world, variant, 0, seed, 'success', **{**told, **more})


def rows_of(world, asked, minutes=None, harmed=None):
    """Rows of each variant in which a person is needed so often, and that take so long."""
    rows = []
    for variant in (BARE, RESTART, DEFAULT, MENU, LEARNED, RANDOM):
        for seed in range(PAIRS):
            rows.append(
                trial(
                    world,
                    variant,
                    seed,
                    failures=int(seed < FAILING),
                    questions=int(seed < asked.get(variant, 0)),
                    sim_s=60.0 * (minutes or {}).get(variant, 1) if seed < FAILING else 20.0,
                    damage=int(seed < (harmed or {}).get(variant, 0)),
                )
            )
    return rows


ASKED = {BARE: 60, RESTART: 50, DEFAULT: 12, MENU: 12, LEARNED: 12, RANDOM: 12}
CHEAP = {LEARNED: 2, RANDOM: 4}


def told(asked=ASKED, minutes=CHEAP, harmed=None, worlds=WORLDS):
    rows = [row for world in worlds for row in rows_of(world, asked, minutes, harmed)]
    return verdicts(rows)


def heads(lines):
    """What is said of each hypothesis."""
    return {line.split(':')[0].strip(): line.split(': ')[-1] for line in lines if line[2] == 'H'}


def test_where_all_is_as_it_should_be_each_hypothesis_holds_and_the_default_changes():
    lines = told()
    names = {line.split(':')[0].strip() for line in lines if line.endswith(': holds')}
    assert {'H1', 'H2', 'H3', 'H4', 'harm'} <= names
    assert '  the default: escalating by one line passes H1, H2 and harm' in lines
    assert sum(line.endswith(': enough') for line in lines) == 4


@pytest.mark.parametrize(
    'change, holding',
    [
        ({'asked': {**ASKED, MENU: 24}}, {'H3', 'H4'}),
        ({'asked': {**ASKED, MENU: 24, DEFAULT: 24, LEARNED: 24}}, {'H2', 'H3', 'H4'}),
        ({'minutes': {LEARNED: 4, RANDOM: 2}}, {'H1', 'H2', 'H4'}),
        ({'asked': {**ASKED, LEARNED: 30}}, {'H1', 'H2', 'H3'}),
    ],
)
def test_a_hypothesis_passes_by_its_own_figures(change, holding):
    rows = [
        row
        for world in WORLDS
        for row in rows_of(world, change.get('asked', ASKED), change.get('minutes', CHEAP))
    ]
    found = {
        each.name: all(one.passed for one in hypotheses.findings(rows, each).values())
        for each in hypotheses.HYPOTHESES
    }
    assert {name for name, passed in found.items() if passed} == holding


def test_one_that_passes_behind_one_that_does_not_is_told_so():
    lines = told(minutes={LEARNED: 4, RANDOM: 2})
    assert any(line.startswith('  H3') and line.endswith('is not shown') for line in lines)
    assert any(
        line.startswith('  H4') and line.endswith('passes, but one before it does not')
        for line in lines
    )


def test_harm_alone_keeps_the_default_as_it_is():
    lines = told(harmed={MENU: 30})
    assert '  the default: prose stays, as H1, H2 and harm do not all pass' in lines


def test_of_one_world_alone_nothing_is_said_to_hold():
    lines = told(worlds=WORLDS[:1])
    assert sum(line.endswith('one world is missing') for line in lines) == 4
    assert not any(': holds' in line for line in lines if line.startswith('  H'))


def test_the_extension_is_decided_by_the_pairs_that_differ_and_not_by_which_way():
    rows = [row for world in WORLDS for row in rows_of(world, ASKED)]
    ways = []
    for better in (MENU, DEFAULT):
        changed = [
            row._replace(questions=1) if row.variant == better and 100 <= row.seed < 130 else row
            for row in rows
        ]
        ways.append([line for line in verdicts(changed) if 'pairs differ' in line][:2])
    assert ways[0] == ways[1] and all(line.endswith('extend') for line in ways[0])


def test_rows_of_other_experiments_take_no_part():
    rows = [row for world in WORLDS for row in rows_of(world, ASKED)]
    others = [row._replace(hour=1.0) for row in rows] + [
        row._replace(lasting_share=0.5, questions=1) for row in rows
    ]
    assert verdicts(rows + others) == verdicts(rows) and verdicts(others) == []


@pytest.mark.parametrize(
    'more, cost',
    [
        ({}, 1.0),
        ({'expert_s': 30.0}, 3.5),
        ({'damage': 2}, 61.0),
        ({'true_success': False}, 61.0),
        ({'sim_s': None, 'damage': None, 'expert_s': None}, 0.0),
    ],
)
def test_a_trial_costs_what_the_prices_say(more, cost):
    assert cost_of(trial('pick_and_place', MENU, 1, **more)) == pytest.approx(cost)


def test_compare_variants_prints_the_verdicts_where_there_are_such_rows(tmp_path, capsys):
    paths = []
    for world in WORLDS:
        paths.append(tmp_path / world)
        append_rows(paths[-1], rows_of(world, ASKED, CHEAP))
    assert comparison.main([str(path) for path in paths]) == 0
    assert (
        'Hypotheses (doc/protocol.md)\n  H1: one_line:escalating needs' in capsys.readouterr().out
    )
    append_rows(tmp_path / 'others', [trial('pick_and_place', 'prose', 1)])
    assert comparison.main([str(tmp_path / 'others')]) == 0
    assert 'Hypotheses' not in capsys.readouterr().out


def test_the_account_of_a_trial_has_each_failure_decision_and_answer():
    kinds = [
        dict(kind=EventKind.TRIAL_START, path='TOP'),
        dict(kind=EventKind.STATE_START, state='PICK'),
        dict(kind=EventKind.FAILURE, state='PICK', outcome='aborted', text='it slips'),
        dict(
            kind=EventKind.DECISION,
            state='PICK',
            outcome='revisit',
            target='PICK',
            rate=0.15,
            data={'decided_by': 'policy', 'order': ['again', 'from LOOK'], 'chance': 1.0},
        ),
        dict(kind=EventKind.JUMP, state='PICK', target='PICK', data={'way': 'again'}),
        dict(kind=EventKind.FAILURE, path='TOP/BELOW', state='GRIP', outcome='lost'),
        dict(kind=EventKind.QUERY_OPENED, state='PICK', text='all ways are tried'),
        dict(kind=EventKind.QUERY_ANSWERED, state='PICK', outcome='goto', target='LOOK', by='me'),
        dict(kind=EventKind.QUERY_OPENED, state='PICK'),
        dict(kind=EventKind.QUERY_EXPIRED, state='PICK'),
    ]
    events = [
        Event(trial_id='t', seq=number, wall_time=0.0, **{'path': 'TOP', **each})
        for number, each in enumerate(kinds)
    ]
    entries = account_of(events)
    assert entries == [
        ('failed', 'PICK', 'aborted', 'it slips'),
        ('decided', 'PICK', 'revisit', 'PICK', 'policy', 0.15, ['again', 'from LOOK'], 1.0),
        ('went', 'PICK', 'PICK', 'again'),
        ('failed', 'BELOW/GRIP', 'lost', ''),
        ('asked', 'PICK', 'all ways are tried'),
        ('answered', 'PICK', 'goto', 'LOOK', 'me'),
        ('asked', 'PICK', ''),
        ('unanswered', 'PICK'),
    ]
    assert account_in(account_text(entries)) == entries
    for wrong in ('[["danced", "PICK"]]', '[["failed"]]', '3'):
        with pytest.raises((ValueError, TypeError)):
            account_in(wrong)


def test_rows_with_extra_causes_decide_nothing():
    rows = [row for world in WORLDS for row in rows_of(world, ASKED, CHEAP)]
    extra = [
        row._replace(seed=row.seed + 10_000, questions=1, damage=2, extra_causes=True)
        for row in rows
    ]
    assert verdicts(rows + extra) == verdicts(rows) and not verdicts(extra)


@pytest.mark.parametrize(
    'harmed, asked_s, unasked',
    [
        ('[["dropped","cup",12.0]]', None, True),
        ('[["dropped","cup",12.0]]', 30.0, True),
        ('[["dropped","cup",42.0]]', 30.0, False),
        ('[["dropped","cup",42.0],["dropped","can",7.0]]', 30.0, True),
        ('[["dropped","cup"]]', 30.0, False),  # nobody knows when
        ('', None, False),
    ],
)
def test_harm_before_a_person_was_asked_is_that_of_the_oracle_alone(harmed, asked_s, unasked):
    damage = len(json.loads(harmed or '[]'))
    row = TrialRow('pick_and_place', MENU, 0, 1, 'success', damage=damage, harmed=harmed)
    assert harmed_unasked(row._replace(asked_s=asked_s)) is unasked


def test_the_verdicts_tell_how_often_harm_came_before_a_person_was_asked():
    lines = told(harmed={MENU: 30})
    assert any(line.endswith(' before a person was asked: 60 beside 0') for line in lines)
