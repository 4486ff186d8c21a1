"""The figures in the table, against figures worked out elsewhere."""

import csv
import io
import json
import math

import pytest

from smach_oracle.analysis import table
from smach_oracle.analysis.bag_events import RecordedCause, SkippedBag
from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.intervals import replicate_interval, t_quantile, wilson_interval
from smach_oracle.analysis.trial_counter import TrialEnding
from smach_oracle.analysis.truth import Truth
from smach_oracle.analysis.variants import (
    ANSWERED,
    NOT_ANSWERED,
    QUESTIONS,
    RECOVERIES,
    TRUE_SUCCESS,
    count_variants,
    find_variants,
    time_series,
)


def trial(number=0, **fields):
    defaults = dict(
        trial_id=str(number),
        experiment='PICK_AND_PLACE',
        recovers=True,
        start_time=float(number),
        duration_s=1.0,
        ending=TrialEnding.SUCCESS,
        outcome='succeeded',
        failures=0,
        recoveries=0,
        questions=0,
        answered=0,
        failures_by_state=(),
        lost_events=0,
        bags=(),
    )
    return TrialSummary(**dict(defaults, **fields))


# scipy 1.10: stats.binomtest(successes, trials).proportion_ci(method='wilson')
@pytest.mark.parametrize(
    'successes, trials, low, high',
    [
        (39, 150, 0.196421, 0.335564),
        (6, 150, 0.018459, 0.084513),
        (0, 10, 0.0, 0.277533),
        (10, 10, 0.722467, 1.0),
        (1, 2, 0.094531, 0.905469),
    ],
)
def test_wilson_interval(successes, trials, low, high):
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=1e-6)


def test_wilson_interval_holds_the_share_and_narrows_with_the_runs():
    widths = []
    for trials in (10, 100, 1000, 10_000):
        low, high = wilson_interval(trials // 5, trials)
        assert 0.0 <= low < 0.2 < high <= 1.0
        widths.append(high - low)
    assert widths == sorted(widths, reverse=True)
    assert math.isclose(widths[-1], 2 * 1.96 * math.sqrt(0.2 * 0.8 / 10_000), rel_tol=0.01)


@pytest.mark.parametrize('successes, trials', [(-1, 10), (11, 10)])
def test_impossible_counts_are_refused(successes, trials):
    with pytest.raises(ValueError, match='allowed: 0 to 10'):
        wilson_interval(successes, trials)


def test_no_runs_say_nothing():
    assert wilson_interval(0, 0) == (0.0, 1.0)


# scipy 1.10: stats.t.interval(0.95, len(shares) - 1, numpy.mean(shares), stats.sem(shares))
@pytest.mark.parametrize(
    'shares, low, high',
    [
        ((0.1, 0.12, 0.15), 0.060817, 0.185849),
        ((0.02, 0.04, 0.06), 0.0, 0.089683),
        ((0.0, 0.2), 0.0, 1.0),
        ((0.3, 0.3), 0.3, 0.3),
    ],
)
def test_the_interval_over_replicates(shares, low, high):
    assert replicate_interval(shares) == pytest.approx((low, high), abs=1e-5)
    assert replicate_interval(shares[:1]) is None


# scipy 1.10: stats.t.ppf(0.975, freedom)
@pytest.mark.parametrize(
    'freedom, quantile',
    [(1, 12.7062), (9, 2.2622), (30, 2.0423), (31, 2.0395), (40, 2.0211), (200, 1.9719)],
)
def test_quantiles_of_students_distribution(freedom, quantile):
    assert t_quantile(freedom) == pytest.approx(quantile, abs=0.0005)


def the_papers_first_experiment():
    return [
        trial(
            number,
            failures=2 * (number < 39),
            recoveries=2 * (number < 39),
            questions=number < 6,
            answered=number < 6,
        )
        for number in range(150)
    ]


def test_the_papers_table_comes_out_of_the_papers_counts():
    (variant,) = count_variants(the_papers_first_experiment())
    assert variant.trials == 150
    assert (variant.of(RECOVERIES).trials, variant.of(RECOVERIES).events) == (39, 78)
    assert (variant.of(ANSWERED).trials, variant.of(ANSWERED).events) == (6, 6)
    row = next(
        line
        for line in table.format_text([variant]).splitlines()
        if line.startswith('PICK_AND_PLACE  with')
    )
    assert row.split() == [
        'PICK_AND_PLACE',
        'with',
        'oracle',
        '150',
        '39',
        '(26.0%)',
        '6',
        '(4.0%)',
        '0',
        '(0.0%)',
        '6',
        '(4.0%)',
    ]


def test_the_text_shows_intervals_and_events():
    text = table.format_text(count_variants(the_papers_first_experiment()))
    line = next(line for line in text.splitlines() if line.startswith('  oracle recoveries'))
    assert line.split() == ['oracle', 'recoveries', '39', '26.0%', '19.6', 'to', '33.6%', '78']


def test_answered_and_unanswered_questions_are_told_apart():
    (variant,) = count_variants(
        [trial(0, questions=2, answered=1), trial(1, questions=1), trial(2)]
    )
    counts = {
        name: (variant.of(name).trials, variant.of(name).events)
        for name in (QUESTIONS, ANSWERED, NOT_ANSWERED)
    }
    assert counts == {QUESTIONS: (2, 3), ANSWERED: (1, 1), NOT_ANSWERED: (2, 2)}


def test_variants_and_experiments_have_rows_of_their_own():
    variants = count_variants(
        [
            trial(0, recovers=False, ending=TrialEnding.FAILURE),
            trial(1),
            trial(2, recovers=None, ending=TrialEnding.UNFINISHED),
            trial(3, experiment='DRINK'),
        ]
    )
    assert [(variant.experiment, variant.name, variant.trials) for variant in variants] == [
        ('DRINK', 'with oracle', 1),
        ('PICK_AND_PLACE', 'with oracle', 1),
        ('PICK_AND_PLACE', 'without oracle', 1),
        ('PICK_AND_PLACE', 'variant unknown', 1),
    ]
    assert variants[2].of('ended in failure').trials == 1
    assert variants[3].of('unfinished').trials == 1


def test_every_trial_has_one_ending():
    (variant,) = count_variants(
        [trial(number, ending=ending) for number, ending in enumerate(TrialEnding)]
    )
    endings = ('ended in success', 'ended in failure', 'preempted', 'unfinished')
    assert [variant.of(name).trials for name in endings] == [1, 1, 1, 1]


def test_missing_events_are_said_beside_the_figures():
    whole = table.format_text(count_variants([trial(0)]))
    gaps = table.format_text(count_variants([trial(0, lost_events=7), trial(1)]))
    assert 'missing' not in whole
    assert '7 events are missing in 1 trials' in gaps


def test_json_holds_table_trials_and_skipped_bags():
    target = io.StringIO()
    trials = [trial(0, failures=1, failures_by_state=(('TOP/PICK', 1),))]
    table.write_json(target, count_variants(trials), trials, [SkippedBag('/x.bag', 'damaged')])
    data = json.loads(target.getvalue())
    assert data['trials'][0]['failures_by_state'] == {'TOP/PICK': 1}
    assert data['trials'][0]['ending'] == 'success'
    assert data['skipped'] == [{'path': '/x.bag', 'reason': 'damaged'}]
    (variant,) = data['groups']
    assert (
        (variant['variant'], variant['trials'])
        == (variant['arm'], variant['runs'])
        == ('with oracle', 1)
    )
    counts = {item['name']: item for item in variant['counts']}
    assert counts['ended in success']['interval'] == pytest.approx([0.2065, 1.0], abs=1e-4)


def test_csv_has_one_line_a_trial():
    target = io.StringIO()
    table.write_csv(target, [trial(0, recoveries=3), trial(1, recovers=None)])
    rows = list(csv.DictReader(io.StringIO(target.getvalue())))
    assert [
        (row['trial_id'], row['recovers'], row['recoveries'], row['ending']) for row in rows
    ] == [('0', 'True', '3', 'success'), ('1', '', '0', 'success')]


def told(number, said, true, kinds=(), **fields):
    """A trial of which the world has told how it ended."""
    return trial(
        number,
        ending=TrialEnding.SUCCESS if said else TrialEnding.FAILURE,
        cause=RecordedCause(number, 'pick_and_place', tuple(kinds), ('',) * len(kinds)),
        truth=Truth(number, 'pick_and_place', true, '', (), 30.0, 5.0, {}),
        **fields,
    )


def test_what_the_machine_says_is_held_against_what_the_world_says():
    trials = [
        told(0, True, True),
        told(1, True, False),
        told(2, False, True),
        told(3, False, False),
        trial(4),
    ]
    (variant,) = count_variants(trials)
    counts = [variant.of(name).trials for name in (TRUE_SUCCESS, 'false success', 'false failure')]
    assert (counts, variant.truth_known) == ([2, 1, 1], 4)
    assert variant.of(TRUE_SUCCESS).share == 0.5, 'of those in which it is known'
    text = table.format_text([variant], trials)
    assert TRUE_SUCCESS in text and 'how a trial truly ended is known of 4 of 5' in text
    assert TRUE_SUCCESS not in table.format_text(count_variants([trial(0)]))


def test_trials_are_counted_by_what_the_world_was_given():
    text = table.format_text(
        count_variants([]),
        [
            told(0, True, True),
            told(1, True, True, ['noise'], failures=1, recoveries=1),
            told(2, False, False, ['noise', 'slippery'], failures=2, questions=1),
        ],
    )
    rows = {
        line.split()[0]: line.split()[1:]
        for line in text.partition('trials by what')[2].splitlines()
        if line.startswith('  ')
    }
    assert rows == {
        'cause': ['trials', 'failed', 'recovered', 'asked', 'succeeded', 'true', 'success'],
        '(none)': ['1', '0', '0', '0', '1', '1'],
        'noise': ['2', '2', '1', '1', '1', '1'],
        'slippery': ['1', '1', '0', '1', '0', '0'],
    }


def test_replicates_are_the_folders_and_have_an_interval_of_their_own():
    trials = [
        trial(number, bags=('/r{}/{}.bag'.format(number % 3, number),), failures=int(number < 5))
        for number in range(30)
    ]
    (variant,) = count_variants(trials)
    count = variant.of('failures of states')
    assert variant.replicates == 3 and count.share == pytest.approx(1 / 6)
    assert count.over_replicates == pytest.approx(replicate_interval([0.2, 0.2, 0.1]))
    line = next(
        line
        for line in table.format_text([variant]).splitlines()
        if line.startswith('  failures of states')
    )
    assert line.split()[-3:] == ['2.3', 'to', '31.0%']


def test_oracles_of_other_settings_are_other_variants():
    variants = find_variants(
        [
            trial(number, settings=(('memory', memory), ('policy', 'prose')))
            for number, memory in enumerate((10, 2, 10))
        ]
        + [trial(3, recovers=False)]
    )
    assert [(variant.name, len(variant.trials)) for variant in variants] == [
        ('with oracle, memory 2', 1),
        ('with oracle, memory 10', 2),
        ('without oracle', 1),
    ]


def test_each_replicate_of_each_oracle_has_a_figure_with_the_trials_without_beside_it():
    def place(folder, replicate, number, **fields):
        return trial(
            number, bags=('/{}/replicate_{}/{}.bag'.format(folder, replicate, number),), **fields
        )

    without = [place('without', replicate, 0, recovers=False) for replicate in range(2)]
    one = [place('with', replicate, 1, settings=(('memory', 2),)) for replicate in range(2)]
    other = [place('with_other', 0, 2, settings=(('memory', 10),))]
    assert time_series(without + one + other) == [
        (('with oracle, memory 2', 'replicate', '0'), (one[0], without[0])),
        (('with oracle, memory 2', 'replicate', '1'), (one[1], without[1])),
        (('with oracle, memory 10',), (other[0], without[0])),
    ]
    assert time_series([one[0], without[0]]) == [((), (one[0], without[0]))]
    assert time_series(without[:1]) == [((), (without[0],))]
    several = time_series([one[0], trial(3, experiment='DRINK')])
    assert [words for words, _ in several] == [('DRINK',), ('PICK_AND_PLACE',)]


def test_csv_and_json_tell_seed_cause_and_truth():
    target = io.StringIO()
    table.write_csv(target, [told(7, True, False, ['noise', 'slippery'])])
    (row,) = csv.DictReader(io.StringIO(target.getvalue()))
    assert (row['seed'], row['causes'], row['true_success']) == ('7', 'noise slippery', 'False')
    assert (row['wrong_object'], row['damage']) == ('', ''), 'a line from before'
    trial_now = told(8, True, False, ['noise'])
    harmed = trial_now.truth._replace(wrong_object='can', damage=(('dropped', 'can'),))
    target = io.StringIO()
    table.write_csv(target, [trial_now._replace(truth=harmed)])
    (row,) = csv.DictReader(io.StringIO(target.getvalue()))
    assert (row['wrong_object'], row['damage']) == ('can', '1')
    target = io.StringIO()
    table.write_json(target, [], [told(7, True, False, ['noise'])], [])
    data = json.loads(target.getvalue())
    assert data['trials'][0]['truth']['success'] is False and data['causes'][0]['kind'] == 'noise'
    assert data['causes'][0]['variant'] == data['causes'][0]['arm'] == 'with oracle'


def test_replicates_that_all_agree_are_given_no_interval_without_width():
    trials = [
        trial(number, recoveries=int(number % 5 == 0), bags=('/{}/a.bag'.format(number // 10),))
        for number in range(20)
    ] + [trial(20, failures=1, bags=('/0/a.bag',))]
    rows = {
        line.strip().split('  ')[0]: line
        for line in table.format_text(count_variants(trials)).splitlines()
    }
    assert rows['unfinished'].endswith('   all alike')
    assert (
        rows['failures of states'].endswith('%') and 'all alike' not in rows['failures of states']
    )


@pytest.mark.parametrize(
    'fields, said, judged, needed',
    [
        ({}, TrialEnding.SUCCESS, True, False),
        ({'questions': 1}, TrialEnding.SUCCESS, True, True),
        ({}, TrialEnding.SUCCESS, False, True),
        ({}, TrialEnding.FAILURE, True, True),
        ({}, TrialEnding.OTHER, True, False),
        ({}, TrialEnding.OTHER, None, None),
        ({}, TrialEnding.SUCCESS, None, None),
        ({'questions': 1}, TrialEnding.SUCCESS, None, True),
        ({}, TrialEnding.FAILURE, None, True),
        ({}, TrialEnding.UNFINISHED, None, True),
    ],
)
def test_a_person_was_needed_where_asked_or_not_truly_successful(fields, said, judged, needed):
    truth = None if judged is None else told(0, True, judged).truth
    assert trial(0, ending=said, truth=truth, **fields).person_needed is needed


def test_another_object_than_the_one_that_was_meant_needs_a_person():
    judged = told(0, True, True)
    assert judged.person_needed is False
    wrong = judged._replace(truth=judged.truth._replace(wrong_object='can'))
    assert wrong.person_needed is True


def test_without_a_judge_the_table_says_that_false_successes_are_not_known():
    trials = [trial(0), trial(1), trial(2, questions=1, answered=1)]
    (variant,) = count_variants(trials)
    assert (variant.of('person needed').trials, variant.unjudged) == (1, 2)
    text = table.format_text([variant])
    assert 'At least: no judge saw 2 trials' in text and 'among 2 others is not known' in text
    judged = table.format_text(count_variants([told(0, True, True)]))
    assert 'At least:' not in judged and 'at least:' not in judged and 'Person needed: ' in judged


def test_the_same_words_are_added_to_json_and_csv_and_the_old_names_stay():
    trials = [trial(0), trial(1, questions=1, answered=1)]
    target = io.StringIO()
    table.write_json(target, count_variants(trials), trials, [])
    data = json.loads(target.getvalue())
    counts = {item['name']: item['trials'] for item in data['groups'][0]['counts']}
    assert (counts['answered'], counts['expert answered'], counts['person needed']) == (1, 1, 1)
    assert [row['person_needed'] for row in data['trials']] == [None, True]
    assert [row['expert_answered'] for row in data['trials']] == [False, True]
    target = io.StringIO()
    table.write_csv(target, trials)
    rows = list(csv.DictReader(io.StringIO(target.getvalue())))
    assert [(row['answered'], row['expert_answered'], row['person_needed']) for row in rows] == [
        ('0', 'False', ''),
        ('1', 'True', 'True'),
    ]


def test_table_one_fits_a_terminal_of_100_columns():
    text = table.format_text(count_variants([told(number, True, True) for number in range(100)]))
    assert max(map(len, text.splitlines())) <= 100
