"""`analysis.read`: what happened in recorded trials as rows, and as frames of pandas."""

import csv
import io
import itertools
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from failing_machines import run
from test_real_machine import FakeExpert, run_trials

from smach_oracle import analysis
from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.recorded import trial_set
from smach_oracle.analysis.recorded.rows import DecisionOnFailure, FailureOfState, Table
from smach_oracle.analysis.recorded.trial_line import TrialLine
from smach_oracle.analysis.table import write_csv

OLD_BAGS = str(Path(__file__).parents[2] / 'data/v0_1')


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Trials in which PICK fails not at all, once, and four times, so that an expert is asked."""
    place = tmp_path_factory.mktemp('recorded') / 'bags'
    run_trials(place, [0, 1, 10], expert=FakeExpert(answers=True))
    return place


@pytest.fixture
def trials(folder):
    return analysis.read(folder)


def test_trials_are_a_sequence_in_the_order_of_their_beginning(trials):
    assert [trial.failures for trial in trials] == [0, 1, 4]
    assert len(trials) == 3 and trials[-1].answered == 1
    assert [trial.failures for trial in trials[1:]] == [1, 4]
    assert [trial.failures for trial in trials.where(lambda trial: not trial.questions)] == [0, 1]
    assert repr(trials) == '<3 trials, 0 bags skipped>'


def test_lines_are_those_of_the_csv(trials):
    text = io.StringIO()
    write_csv(text, trials)
    rows = list(csv.DictReader(io.StringIO(text.getvalue())))
    assert list(rows[0]) == list(TrialLine._fields)
    for row, line in zip(rows, trials.lines()):
        assert row == {
            name: '' if value is None else str(value) for name, value in line._asdict().items()
        }


def test_each_failure_has_the_way_that_was_gone_next(trials):
    failures = trials.failures()
    assert repr(failures) == '<5 rows of FailureOfState>'
    assert {row.state for row in failures} == {'TOP/PICK'}
    assert [row.trial_id for row in failures] == [trials[1].trial_id] + [trials[2].trial_id] * 4
    assert [(row.way, row.helped, row.by_expert) for row in failures] == [
        ('trying it again', True, False),
        ('trying it again', False, False),
        ('going back to LOOK', False, False),
        ('going back to LOOK', False, False),
        ('expert: did its work', True, True),
    ]
    seconds = [row.seconds for row in failures if row.trial_id == trials[2].trial_id]
    assert seconds == sorted(seconds) and seconds[0] > 0
    assert all(row.way_s >= 0 and row.kind == 'fell_through' for row in failures)


def test_each_decision_has_what_came_of_it(trials):
    decisions = trials.decisions()
    assert [(row.decision, row.target, row.way, row.helped) for row in decisions] == [
        ('revisit', 'PICK', 'trying it again', True),
        ('revisit', 'PICK', 'trying it again', False),
        ('step_back', 'LOOK', 'going back to LOOK', False),
        ('step_back', 'LOOK', 'going back to LOOK', False),
        ('ask', '', '', None),
    ]
    assert {row.decided_by for row in decisions} == {'policy', 'max_recoveries'}
    assert decisions[-1].way_s is None and decisions[0].way_s >= 0
    assert all(0 <= row.rate <= 1 and row.failure_class for row in decisions)


def test_states_are_counted_trial_by_trial(trials):
    of_pick = [row for row in trials.states() if row.state == 'TOP/PICK']
    assert [(row.visits, row.failures, row.questions) for row in of_pick] == [
        (1, 0, 0),
        (2, 1, 0),
        (4, 4, 1),
    ]


def test_bags_are_read_again_once_and_only_where_events_are_needed(folder, monkeypatch):
    trials = analysis.read(folder)
    asked = []
    of_module = trial_set.events_of
    monkeypatch.setattr(trial_set, 'events_of', lambda each: asked.append(each) or of_module(each))
    trials.lines()
    assert not asked
    trials.states(), trials.failures(), trials.decisions()
    assert len(asked) == 1


def test_a_bag_that_is_gone_is_named(folder, tmp_path):
    place = tmp_path / 'bags'
    shutil.copytree(folder, place)
    trials = analysis.read(place)
    gone = sorted(place.glob('*.bag'))[1]
    gone.unlink()
    with pytest.raises(BagError, match=gone.name):
        trials.failures()


def test_a_trial_in_two_bags_has_its_rows_once(folder, tmp_path):
    place = tmp_path / 'bags'
    shutil.copytree(folder, place)
    shutil.copytree(folder, place / 'again')
    assert len(analysis.read(place).failures()) == len(analysis.read(folder).failures())


def test_where_nothing_is_to_be_read_it_says_so(tmp_path):
    with pytest.raises(BagError, match='no bags'):
        analysis.read(tmp_path)
    with pytest.raises(BagError, match='no such folder'):
        analysis.read(tmp_path / 'nowhere')


def test_outcomes_that_fail_may_be_told(folder):
    assert {trial.succeeded for trial in analysis.read(folder)} == {True}
    told = analysis.read(folder, failing_outcomes=['succeeded'])
    assert {trial.succeeded for trial in told} == {False}
    assert len(told.failures()) == 5


def test_old_bags_have_rows_too():
    trials = analysis.read(OLD_BAGS)
    assert len(trials.lines()) == len(trials)
    assert {row.trial_id for row in trials.states()} <= {trial.trial_id for trial in trials}


@pytest.mark.parametrize('seed', range(4))
def test_rows_agree_with_the_counts_of_trials(seed, monkeypatch):
    given = [(summarise(events), events) for events in run(30, seed=seed)]
    trials = trial_set.TrialSet([trial for trial, _ in given])
    monkeypatch.setattr(trial_set, 'events_of', lambda each: given)
    failures = trials.failures()
    assert len(failures) == sum(trial.failures for trial in trials) > 0
    for trial in trials:
        of_it = [row for row in failures if row.trial_id == trial.trial_id]
        assert len(of_it) == trial.failures
        assert all(0 <= row.seconds <= trial.duration_s for row in of_it)
    by_state = itertools.groupby(sorted(row.state for row in failures))
    counted = {}
    for row in trials.states():
        counted[row.state] = counted.get(row.state, 0) + row.failures
    assert {state: len(list(rows)) for state, rows in by_state} == {
        state: number for state, number in counted.items() if number
    }


def test_frames_have_a_type_for_each_column(trials):
    pandas = pytest.importorskip('pandas')
    frame = trials.to_frame()
    assert list(frame.columns) == list(TrialLine._fields) and len(frame) == 3
    assert frame.dtypes['failures'] == 'int64' and frame.dtypes['duration_s'] == 'float64'
    assert frame.dtypes['true_success'] == 'boolean' and frame.dtypes['seed'] == 'Int64'
    assert frame['true_success'].isna().all() and frame['expert_answered'].sum() == 1
    failures = trials.failures().to_frame()
    assert failures.groupby('way')['helped'].mean()['trying it again'] == 0.5
    assert isinstance(trials.states().to_frame(), pandas.DataFrame)


@pytest.mark.parametrize('row_type', [FailureOfState, DecisionOnFailure, TrialLine])
def test_a_frame_without_rows_has_its_columns(trials, row_type):
    pytest.importorskip('pandas')
    frame = Table(row_type, []).to_frame()
    assert list(frame.columns) == list(row_type._fields) and len(frame) == 0
    full = {
        FailureOfState: trials.failures,
        DecisionOnFailure: trials.decisions,
        TrialLine: trials.lines,
    }[row_type]()
    assert full and frame.dtypes.equals(full.to_frame().dtypes)


def test_neither_pandas_nor_ros_is_needed_to_read(folder):
    script = (
        'import sys\n'
        'sys.modules.update(pandas=None, rospy=None, smach=None)\n'
        'from smach_oracle import analysis\n'
        'trials = analysis.read(sys.argv[1])\n'
        'print(len(trials), len(trials.failures()))\n'
        'try:\n'
        '    trials.to_frame()\n'
        'except ImportError as err:\n'
        '    print(err.name)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', script, str(folder)], check=True, stdout=subprocess.PIPE
    )
    assert done.stdout.split() == [b'3', b'5', b'pandas']


def test_there_is_nothing_else_in_the_analysis_by_that_way():
    with pytest.raises(AttributeError, match='no attribute'):
        analysis.raed  # noqa: B018
