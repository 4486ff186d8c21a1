"""The figures in the table, against figures worked out elsewhere."""
import csv
import io
import json
import math

import pytest

from smach_oracle.analysis import table
from smach_oracle.analysis.bag_events import Skipped
from smach_oracle.analysis.trials import Ending, TrialSummary


def trial(number=0, **fields):
    defaults = dict(trial_id=str(number), experiment='PICK_AND_PLACE', recovers=True, start_time=float(number),
                    duration_s=1.0, ending=Ending.SUCCESS, outcome='succeeded', failures=0, recoveries=0, questions=0,
                    answered=0, failures_by_state=(), lost_events=0, bags=())
    return TrialSummary(**dict(defaults, **fields))


# scipy 1.10: stats.binomtest(successes, runs).proportion_ci(method='wilson')
@pytest.mark.parametrize('successes, runs, low, high', [
    (39, 150, 0.196421, 0.335564), (6, 150, 0.018459, 0.084513), (0, 10, 0.0, 0.277533), (10, 10, 0.722467, 1.0),
    (1, 2, 0.094531, 0.905469)])
def test_wilson_interval(successes, runs, low, high):
    assert table.wilson_interval(successes, runs) == pytest.approx((low, high), abs=1e-6)


def test_wilson_interval_holds_the_share_and_narrows_with_the_runs():
    widths = []
    for runs in (10, 100, 1000, 10_000):
        low, high = table.wilson_interval(runs // 5, runs)
        assert 0.0 <= low < 0.2 < high <= 1.0
        widths.append(high - low)
    assert widths == sorted(widths, reverse=True)
    assert math.isclose(widths[-1], 2 * 1.96 * math.sqrt(0.2 * 0.8 / 10_000), rel_tol=0.01)


@pytest.mark.parametrize('successes, runs', [(-1, 10), (11, 10)])
def test_impossible_counts_are_refused(successes, runs):
    with pytest.raises(ValueError, match='allowed: 0 to 10'):
        table.wilson_interval(successes, runs)


def test_no_runs_say_nothing():
    assert table.wilson_interval(0, 0) == (0.0, 1.0)


def the_papers_first_experiment():
    return [trial(number, failures=2 * (number < 39), recoveries=2 * (number < 39), questions=number < 6,
                  answered=number < 6) for number in range(150)]


def test_the_papers_table_comes_out_of_the_papers_counts():
    (group,) = table.make_groups(the_papers_first_experiment())
    assert group.runs == 150
    assert (group.of(table.RECOVERIES).trials, group.of(table.RECOVERIES).events) == (39, 78)
    assert (group.of(table.ANSWERED).trials, group.of(table.ANSWERED).events) == (6, 6)
    row = next(line for line in table.format_text([group]).splitlines() if line.startswith('PICK_AND_PLACE  with'))
    assert row.split() == ['PICK_AND_PLACE', 'with', 'oracle', '150', '39', '(26.0%)', '6', '(4.0%)', '0', '(0.0%)']


def test_the_text_shows_intervals_and_events():
    text = table.format_text(table.make_groups(the_papers_first_experiment()))
    line = next(line for line in text.splitlines() if line.startswith('  oracle recoveries'))
    assert line.split() == ['oracle', 'recoveries', '39', '26.0%', '19.6', 'to', '33.6%', '78']


def test_answered_and_unanswered_questions_are_told_apart():
    (group,) = table.make_groups([trial(0, questions=2, answered=1), trial(1, questions=1), trial(2)])
    counts = {name: (group.of(name).trials, group.of(name).events)
              for name in (table.QUESTIONS, table.ANSWERED, table.NOT_ANSWERED)}
    assert counts == {table.QUESTIONS: (2, 3), table.ANSWERED: (1, 1), table.NOT_ANSWERED: (2, 2)}


def test_arms_and_experiments_have_rows_of_their_own():
    groups = table.make_groups([
        trial(0, recovers=False, ending=Ending.FAILURE), trial(1), trial(2, recovers=None, ending=Ending.UNFINISHED),
        trial(3, experiment='DRINK')])
    assert [(group.experiment, group.arm, group.runs) for group in groups] == [
        ('DRINK', 'with oracle', 1), ('PICK_AND_PLACE', 'with oracle', 1), ('PICK_AND_PLACE', 'without oracle', 1),
        ('PICK_AND_PLACE', 'arm unknown', 1)]
    assert groups[2].of('ended in failure').trials == 1
    assert groups[3].of('unfinished').trials == 1


def test_every_trial_has_one_ending():
    (group,) = table.make_groups([trial(number, ending=ending) for number, ending in enumerate(Ending)])
    endings = ('ended in success', 'ended in failure', 'preempted', 'unfinished')
    assert [group.of(name).trials for name in endings] == [1, 1, 1, 1]


def test_missing_events_are_said_beside_the_figures():
    whole = table.format_text(table.make_groups([trial(0)]))
    gaps = table.format_text(table.make_groups([trial(0, lost_events=7), trial(1)]))
    assert 'missing' not in whole
    assert '7 events are missing in 1 trials' in gaps


def test_json_holds_table_trials_and_skipped_bags():
    target = io.StringIO()
    trials = [trial(0, failures=1, failures_by_state=(('TOP/PICK', 1),))]
    table.write_json(target, table.make_groups(trials), trials, [Skipped('/x.bag', 'damaged')])
    data = json.loads(target.getvalue())
    assert data['trials'][0]['failures_by_state'] == {'TOP/PICK': 1}
    assert data['trials'][0]['ending'] == 'success'
    assert data['skipped'] == [{'path': '/x.bag', 'reason': 'damaged'}]
    counts = {item['name']: item for item in data['groups'][0]['counts']}
    assert counts['ended in success']['interval'] == pytest.approx([0.2065, 1.0], abs=1e-4)


def test_csv_has_one_line_a_trial():
    target = io.StringIO()
    table.write_csv(target, [trial(0, recoveries=3), trial(1, recovers=None)])
    rows = list(csv.DictReader(io.StringIO(target.getvalue())))
    assert [(row['trial_id'], row['recovers'], row['recoveries'], row['ending']) for row in rows] == [
        ('0', 'True', '3', 'success'), ('1', '', '0', 'success')]
