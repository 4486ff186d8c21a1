"""The rows that an experiment keeps of its trials, and what follows from them."""

import csv
import io
import math

import pytest

from smach_oracle.analysis import comparison
from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.intervals import paired_difference
from smach_oracle.analysis.pairing import (
    HINDSIGHT,
    hindsight,
    mcnemar_exact,
    paired_counts,
    trend_of,
)
from smach_oracle.analysis.trial_rows import (
    NO_DETAILS,
    TrialRow,
    append_rows,
    cut_torn_line,
    details_of,
    read_details,
    read_rows,
)


def row(seed=1, variant='prose', **more):
    """A trial that went well."""
    return TrialRow(
        **{
            **dict(
                task='pick',
                variant=variant,
                replicate=0,
                seed=seed,
                ending='success',
                true_success=True,
                wrong_object='',
                damage=0,
                expert_s=0.0,
                sim_s=60.0,
            ),
            **more,
        }
    )


@pytest.mark.parametrize(
    'fields, succeeded, intervened, recovered',
    [
        ({}, True, False, False),
        ({'failures': 1, 'attempts': 1}, True, False, True),
        ({'failures': 1, 'questions': 1}, True, True, False),  # a person acted
        ({'failures': 1, 'attempts': 1, 'questions': 1}, True, True, False),
        ({'ending': 'failure', 'true_success': False, 'failures': 1}, False, True, False),
        ({'true_success': False}, False, True, False),  # false success
        ({'ending': 'failure', 'failures': 1}, False, True, False),  # false failure
        ({'wrong_object': 'cup', 'failures': 1}, False, True, False),
        ({'ending': 'lost', 'true_success': None}, False, True, False),
        ({'ending': 'unfinished', 'true_success': None}, False, True, False),
        ({'true_success': None, 'failures': 1}, True, False, True),  # nobody judged
    ],
)
def test_an_intervention_is_whatever_a_person_must_do(fields, succeeded, intervened, recovered):
    trial = row(**fields)
    assert (trial.succeeded, trial.intervened, trial.recovered) == (
        succeeded,
        intervened,
        recovered,
    )


def test_rows_come_back_as_they_were_written(tmp_path):
    path = tmp_path / 'results.csv'
    rows = [
        row(1, causes='glare dim_light', why='it stands, 0.2 cm off', learned='{"A": [1]}'),
        row(
            2,
            ending='lost',
            true_success=None,
            wrong_object=None,
            damage=None,
            expert_s=None,
            sim_s=None,
        ),
        row(
            3,
            wrong_object='cup',
            true_success=False,
            lasting=2,
            lasting_share=0.5,
            wall_s=2.5,
            hour=1.25,
            left='{"ended": 1.3}',
            memory=10,
            prior=0.1,
            cause_log='[["glare",true,4.2,null]]',
            tries='[["PICK",1.5,3.0,0]]',
            harmed='[["dropped","object_0",12.5],["knocked_over","object_1"]]',
            asked_s=40.25,
            account='[["failed","PICK","aborted","it slips"],["asked","PICK",""]]',
            shared=False,
        ),
    ]
    append_rows(path, rows[:1])
    append_rows(path, rows[1:])
    assert read_rows(path) == rows


def test_a_line_that_was_cut_off_is_not_read_and_is_written_anew(tmp_path):
    path = tmp_path / 'results.csv'
    append_rows(path, [row(1), row(2)])
    path.write_text(path.read_text()[:-5])
    assert read_rows(path) == [row(1)]
    cut_torn_line(path)
    append_rows(path, [row(2), row(3)])
    assert read_rows(path) == [row(1), row(2), row(3)]


def test_of_the_same_trial_the_later_row_counts(tmp_path):
    path = tmp_path / 'results.csv'
    append_rows(path, [row(1, questions=3), row(1)])
    assert read_rows(path) == [row(1)]


@pytest.mark.parametrize(
    'column, text',
    [
        ('seed', 'x'),
        ('true_success', 'perhaps'),
        ('ending', 'won'),
        ('replicate', ''),
        ('cause_log', '[["glare"]]'),
        ('tries', '[3]'),
        ('tries', '{'),
    ],
)
def test_a_wrong_cell_is_named(tmp_path, column, text):
    path = tmp_path / 'results.csv'
    append_rows(path, [row()._replace(**{column: text})])
    with pytest.raises(BagError, match='row 2: {}'.format(column)):
        read_rows(path)


def test_other_columns_are_refused(tmp_path):
    path = tmp_path / 'results.csv'
    path.write_text('task,seed\npick,1\n')
    with pytest.raises(BagError, match='columns'):
        read_rows(path)


def older(path, rows):
    """Write rows as the version before the world's log was in them did."""
    append_rows(path, rows)
    lines = list(csv.reader(io.StringIO(path.read_text())))
    with path.open('w', newline='') as target:
        csv.writer(target, lineterminator='\n').writerows(line[:23] for line in lines)
    assert path.read_text().startswith('task,variant,replicate,seed,ending,true_success,')
    assert path.read_text().splitlines()[0].endswith(',wall_s,hour,left')


def test_rows_of_an_older_version_are_read_and_gone_on_with(tmp_path):
    path = tmp_path / 'results.csv'
    older(path, [row(1, memory=10, cause_log='[]'), row(2)])
    assert read_rows(path) == [row(1), row(2)]
    append_rows(path, [row(3, memory=10)])
    assert read_rows(path) == [row(1), row(2), row(3, memory=10)]
    assert [item.name for item in tmp_path.iterdir()] == ['results.csv']


# -- truth


def test_what_older_truth_does_not_tell_is_not_known(tmp_path):
    path = tmp_path / 'truth.jsonl'
    path.write_text(
        '{"seed": 1, "causes": [{"kind": "glare", "text": "t"}]}\n'
        '{"seed": 2, "causes": [{"kind": "glare", "lasting": true}, '
        '{"kind": "dim", "lasting": false}], "wrong_object": "cup", '
        '"damage": {"count": 2, "dropped": ["a", "b"], "pushed_off": []}, '
        '"passed_s": {"expert": 12.5}, "wall_s": 9, "hour": 0.5, '
        '"left": {"ended": 1}}\n{"se'
    )
    details = read_details(str(path))
    assert details == {
        1: NO_DETAILS,
        2: (
            'cup',
            2,
            {'expert': 12.5},
            1,
            9.0,
            0.5,
            {'ended': 1},
            None,
            None,
            False,
            (('dropped', 'a', None), ('dropped', 'b', None)),
        ),
    }
    assert details_of({'damage': {'dropped': 3}}).damage == 3


# -- pairs


@pytest.mark.parametrize(
    'first, second, p_value',
    [
        (0, 0, 1.0),
        (5, 5, 1.0),
        (0, 1, 1.0),
        (0, 6, 0.03125),
        (6, 0, 0.03125),
        (2, 10, 0.03857421875),
        (1, 39, 7.457856554538012e-11),
    ],
)  # as scipy.stats.binomtest gives them
def test_the_exact_test(first, second, p_value):
    assert mcnemar_exact(first, second) == pytest.approx(p_value, rel=1e-9)


def test_the_exact_test_refuses_what_is_no_number_of_trials():
    with pytest.raises(ValueError, match='not allowed'):
        mcnemar_exact(-1, 2)


def test_pairs_are_trials_of_the_same_seed_that_both_ran():
    ours = [row(seed, questions=seed % 2) for seed in range(1, 7)]
    theirs = [row(seed, 'restart', questions=1) for seed in range(2, 9)]
    counts = paired_counts(ours, theirs, lambda trial: trial.intervened)
    assert counts == (2, 0, 3, 0) and counts.p_value == 0.25


@pytest.mark.parametrize(
    'counts, low, high',
    [
        # Fagerland, Lydersen and Laake, Stat. Med. 33, 2014: airway hyperresponsiveness
        ((1, 1, 7, 12), -0.507, -0.026),
        ((0, 0, 0, 10), -0.278, 0.278),
        ((10, 0, 0, 0), -0.278, 0.278),
        ((0, 0, 10, 0), -1.0, -0.607),
    ],
)
def test_the_interval_of_a_paired_difference(counts, low, high):
    assert paired_difference(*counts) == pytest.approx((low, high), abs=1e-3)
    assert paired_difference(counts[0], counts[2], counts[1], counts[3]) == pytest.approx(
        (-high, -low), abs=1e-3
    )


def test_a_trend_is_that_within_seeds():
    """Within a seed all orders are alike under the null: the variance is that of them."""
    scores = {'a': 0.0, 'b': 1.0, 'c': 2.0}
    rows = [
        row(seed, name, questions=int(name in asked))
        for seed, asked in enumerate(('c', 'c', 'bc', 'abc', ''))
        for name in scores
    ]
    z, p_value = trend_of(rows, lambda each: scores[each.variant], lambda each: each.questions > 0)
    assert z == pytest.approx(3.0 / math.sqrt(3 * 2 / 3))
    assert p_value == pytest.approx(math.erfc(z / math.sqrt(2)))
    assert trend_of(rows[-3:], lambda each: scores[each.variant], lambda each: True) is None


def test_hindsight_is_the_best_of_each_trial_that_all_ran():
    rows = [
        row(1, questions=2),
        row(1, 'restart'),
        row(2, ending='failure'),
        row(2, 'restart', ending='lost'),
        row(3),
        row(3, 'restart', sim_s=10.0),
        row(4),
    ]
    best = hindsight(rows)
    assert [(each.seed, each.variant) for each in best] == [(seed, HINDSIGHT) for seed in (1, 2, 3)]
    assert [each.intervened for each in best] == [False, True, False]
    assert best[2].sim_s == 10.0


# -- figures


def test_costs_are_told_a_trial_and_a_robot_hour():
    costs = comparison.costs_of(
        [
            row(1, questions=3, expert_s=90.0, attempts=2, sim_s=1800.0),
            row(2, damage=2, sim_s=1800.0),
            row(3, ending='lost', sim_s=None, expert_s=None, damage=None, wrong_object=None),
        ]
    )
    assert costs.questions_per_hour == pytest.approx(3.0)
    assert (costs.expert_s, costs.expert_s_per_hour) == (pytest.approx(45.0), pytest.approx(90.0))
    assert (costs.damage, costs.wrong_objects, costs.completion_s) == (1.0, 0, 1800.0)
    assert (costs.trials_between, costs.hours_between) == (1.5, pytest.approx(0.5))


def test_damage_is_that_of_all_trials_for_each_completed_task():
    costs = comparison.costs_of(
        [
            row(1, damage=1),
            row(2),
            row(3, ending='failure', true_success=False, damage=3),
            row(4, ending='lost', true_success=None, damage=None, wrong_object=None),
        ]
    )
    assert (costs.damage, costs.damage_done) == (2.0, 0.5), 'what fell in a failed trial, too'


def test_what_is_not_known_of_all_trials_is_not_told():
    costs = comparison.costs_of([row(1, sim_s=None, damage=None, wrong_object=None), row(2)])
    assert costs[2:9] == (None, 0.0, None, None, None, None, 60.0)
    assert costs.trials_between is None


def test_the_command_compares_all_variants(tmp_path, capsys):
    path = tmp_path / 'results.csv'
    append_rows(
        path,
        [row(seed, replicate=seed % 2) for seed in range(10)]
        + [
            row(seed, 'bare', ending='failure', true_success=False, failures=1, replicate=seed % 2)
            for seed in range(10)
        ],
    )
    assert comparison.main([str(path)]) == 0
    text = capsys.readouterr().out
    assert 'prose (10 trials, 2 replicates)' in text and HINDSIGHT in text
    assert 'person needed, bare against prose: 10 trials under bare alone, 0 under prose' in text
    assert 'McNemar p = 0.00195' in text
    assert 'person needed        10  100.0% (72.2% to 100.0%)' in text


def test_the_command_says_where_there_is_nothing(tmp_path, capsys):
    assert comparison.main([str(tmp_path / 'none.csv')]) == 2
    assert 'none.csv' in capsys.readouterr().err
