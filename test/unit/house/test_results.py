"""The page of results says what the rows of the experiment say, and the rows are all there."""

import re

import pytest
from house import ROOT

from smach_oracle.analysis.comparison import verdicts_text
from smach_oracle.analysis.drawing.command import find_rows, tables_page
from smach_oracle.analysis.pairing import COMPARED, on_common_seeds
from smach_oracle.analysis.trial_rows import read_rows
from smach_oracle.experiment.freeze import standing_freezes
from smach_oracle.experiment.protocols import ALL, ProtocolChoice, parts_of

TRIALS = ROOT / 'doc/trials/fourth'  # of the fourth freeze
FIFTH = ROOT / 'doc/trials/fifth'  # of the fifth
PAGE, TABLES, BY_ONE_LINE, TABLES_BY_ONE_LINE = (
    (ROOT / 'doc' / (name + '.md')).read_text(encoding='utf-8')
    for name in (
        'results',
        'inside/results_tables',
        'results_one_line',
        'inside/results_one_line_tables',
    )
)
PAGES = [(TRIALS, PAGE, TABLES), (FIFTH, BY_ONE_LINE, TABLES_BY_ONE_LINE)]
OF_FOURTH, OF_FIFTH = (freeze.blocks() for freeze in standing_freezes(ROOT))
PARTS = parts_of(ALL, ProtocolChoice(OF_FOURTH, 15.0))
PARTS_OF_FIFTH = [
    part
    for protocol in ('fifth', 'fifth_extension')
    for part in parts_of(protocol, ProtocolChoice(OF_FIFTH, 15.0))
]


def trials_of(part):
    """The trials that a part plans: variant, replicate and seed."""
    plan = part.plan
    return {
        (variant.name, replicate, plan.first_seed(replicate) + number)
        for variant in plan.variants
        for replicate in range(plan.replicates)
        for number in range(plan.trials)
    }


@pytest.mark.parametrize('part', PARTS, ids=lambda part: part.name)
def test_each_part_has_all_its_trials_on_the_seeds_of_the_freeze(part):
    path = TRIALS / part.name / 'results.csv'
    found = [(row.variant, row.replicate, row.seed) for row in read_rows(path)]
    assert len(set(found)) == len(found) and set(found) == trials_of(part)


def test_no_other_rows_lie_there():
    assert {path.parent.name for path in TRIALS.rglob('results.csv')} == {
        part.name for part in PARTS
    }


@pytest.mark.parametrize('part', PARTS_OF_FIFTH, ids=lambda part: part.name)
def test_what_is_there_of_the_fifth_freeze_is_of_its_seeds(part):
    path = FIFTH / part.name / 'results.csv'
    rows = read_rows(path) if path.exists() else []
    found = [(row.variant, row.replicate, row.seed) for row in rows]
    assert len(set(found)) == len(found) and set(found) <= trials_of(part)


def test_rows_of_the_fifth_freeze_are_of_its_parts():
    names = {path.parent.name for path in FIFTH.rglob('results.csv')}
    assert names <= {part.name for part in PARTS_OF_FIFTH}


@pytest.mark.parametrize('folder, _, tables', PAGES, ids=['fourth', 'fifth'])
def test_the_page_of_tables_is_made_of_the_rows(folder, _, tables):
    assert tables_page(find_rows(folder)) == tables


@pytest.mark.parametrize('_, page, tables', PAGES, ids=['fourth', 'fifth'])
def test_each_line_of_a_table_of_the_page_stands_in_the_page_of_tables(_, page, tables):
    lines = [line for line in page.splitlines() if line.startswith('|')]
    assert len(lines) > 20
    assert [line for line in lines if line not in tables.splitlines()] == []


def test_the_page_by_one_line_has_the_verdicts_of_the_rows():
    rows = [row for path in sorted(FIFTH.rglob('results.csv')) for row in read_rows(path)]
    assert verdicts_text(rows) in BY_ONE_LINE


@pytest.mark.parametrize(
    'task, without, words',
    [
        (
            'pick_and_place',
            {'glare', 'goal_occupied', 'edge_of_reach', 'slippery_object'},
            r'In the (\d+) without, it was (\d+), (\d+) and (\d+)',
        ),
        (
            'drink_retrieval',
            {'glare', 'slippery_drink'},
            r'There are (\d+) trials without these two. '
            r'A person was needed in (\d+), (\d+) and (\d+) of them',
        ),
    ],
)
def test_the_page_tells_how_it_is_without_a_few_causes(task, without, words):
    rows = on_common_seeds(read_rows(TRIALS / (task + '_compared') / 'results.csv'))
    kept = [row for row in rows if not without & set(row.causes.split())]
    counts = {name: sum(row.intervened for row in kept if row.variant == name) for name in COMPARED}
    told = re.search(words, ' '.join(PAGE.split()))
    assert told and tuple(map(int, told.groups())) == (
        len(kept) // len(COMPARED),
        *(counts[name] for name in COMPARED),
    )
