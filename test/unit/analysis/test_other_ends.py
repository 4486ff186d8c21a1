"""Trials whose ends say neither success nor failure are counted apart, each by its own rule."""

import csv
import io
import json

import pytest
from fake_trials import FakeMachine
from test_table import trial
from test_trial_summaries import story

from smach_oracle.analysis import bag_statistics, comparison, figure
from smach_oracle.analysis.bag_events import RecordedCause
from smach_oracle.analysis.causes import cause_rows, format_causes
from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.drawing.tables import format_tables
from smach_oracle.analysis.table import as_data, format_text, write_csv
from smach_oracle.analysis.trial_counter import TrialEnding
from smach_oracle.analysis.trial_rows import TrialRow, append_rows, read_rows
from smach_oracle.analysis.trials import load_trials
from smach_oracle.analysis.truth import Truth
from smach_oracle.analysis.variants import OTHER_END, count_variants
from smach_oracle.experiment.progress import describe_trials
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.settings.failure_rule import FORMER_RULE, RULE, FailureRule
from smach_oracle.ros.recorder import TrialRecorder

BY_NAME = FailureRule()
ENDED = ('ended in success', 'ended in failure', OTHER_END, 'preempted', 'unfinished')


def ended(outcome, rule=BY_NAME, *between):
    data = {'recovers': True}
    if rule is not None:
        data[RULE] = rule.as_data()
    start = (EventKind.TRIAL_START, {'data': data})
    return summarise(story(start, *between, (EventKind.TRIAL_END, {'outcome': outcome})))


@pytest.mark.parametrize(
    'outcome, rule, ending',
    [
        ('parked', BY_NAME, TrialEnding.OTHER),
        ('done', BY_NAME, TrialEnding.SUCCESS),
        ('fail', BY_NAME, TrialEnding.FAILURE),
        ('task_preempted', BY_NAME, TrialEnding.PREEMPTED),
        ('parked', FailureRule(('lost',)), TrialEnding.SUCCESS),
        ('lost', FailureRule(('lost',)), TrialEnding.FAILURE),
        ('aborted', FailureRule(('lost',)), TrialEnding.SUCCESS),
        ('parked', None, TrialEnding.SUCCESS),  # of an earlier version
        ('fail', None, TrialEnding.SUCCESS),
        ('grasp_failed', None, TrialEnding.FAILURE),
    ],
)
def test_a_trial_is_counted_by_the_rule_that_its_record_names(outcome, rule, ending):
    assert ended(outcome, rule).ending is ending


def test_a_trial_that_went_on_by_another_rule_is_counted_by_the_last_one():
    resumed = (EventKind.RESUMED, {'data': {'last_seq': 0, RULE: BY_NAME.as_data()}})
    assert ended('parked', FORMER_RULE, resumed).ending is TrialEnding.OTHER
    resumed_before = (EventKind.RESUMED, {'data': {'last_seq': 0}})
    assert ended('parked', BY_NAME, resumed_before).ending is TrialEnding.OTHER


def test_each_trial_has_one_end_and_the_ends_add_up_to_the_trials():
    endings = list(TrialEnding) * 2 + [TrialEnding.OTHER]
    (variant,) = count_variants(
        [trial(number, ending=ending) for number, ending in enumerate(endings)]
    )
    assert [variant.of(name).trials for name in ENDED] == [2, 2, 3, 2, 2]
    assert sum(variant.of(name).trials for name in ENDED) == variant.trials == 11


def test_the_table_shows_other_ends_where_there_are_some_and_is_as_before_elsewhere():
    found = [trial(0), trial(1, ending=TrialEnding.OTHER, outcome='parked')]
    found += [trial(2, experiment='ANOTHER')]
    text = format_text(count_variants(found), found)
    head = next(line for line in text.splitlines() if line.startswith('Experiment'))
    assert head.split()[-3:] == ['failure', 'end', 'needed']
    rows = {line.split()[0]: line.split()[-4:] for line in text.splitlines()[5:7]}
    assert rows['PICK_AND_PLACE'] == ['1', '(50.0%)', '0', '(0.0%)']
    assert rows['ANOTHER'] == ['0', '(0.0%)', '0', '(0.0%)']
    assert text.count('  other end ') == 1
    plain = [trial(0), trial(1, ending=TrialEnding.FAILURE)]
    assert 'ther end' not in format_text(count_variants(plain), plain)


def test_the_judge_s_rows_know_an_end_that_claims_nothing():
    truths = [True, False]
    found = [
        trial(
            number,
            ending=TrialEnding.OTHER,
            truth=Truth(number, 'task', success, '', (), 1.0, 1.0, {}),
        )
        for number, success in enumerate(truths)
    ]
    (variant,) = count_variants(found)
    names = ('true success', 'false success', 'false failure')
    assert [variant.of(name).trials for name in names] == [1, 0, 0]


def test_files_have_the_end_and_the_rule():
    found = [
        trial(0, ending=TrialEnding.OTHER, outcome='parked', rule=BY_NAME),
        trial(1),
    ]
    data = json.loads(json.dumps(as_data(count_variants(found), found, [])))
    assert [each['ending'] for each in data['trials']] == ['other', 'success']
    assert [each.get(RULE) for each in data['trials']] == [{'by_name': 1}, None]
    text = io.StringIO()
    write_csv(text, found)
    rows = list(csv.DictReader(io.StringIO(text.getvalue())))
    assert [row['ending'] for row in rows] == ['other', 'success'] and 'rule' not in rows[0]


def test_causes_tell_other_ends_where_there_are_some():
    cause = RecordedCause(1, 'task', ('slip',), ('',))
    found = [trial(0, cause=cause), trial(1, cause=cause, ending=TrialEnding.OTHER)]
    text = format_causes(cause_rows(found))
    assert text.splitlines()[2].endswith('other end') and text.splitlines()[3].split()[-1] == '1'
    assert 'other end' not in format_causes(cause_rows(found[:1]))


def test_the_figure_has_a_line_of_other_ends_where_there_are_some():
    def labels(found):
        with figure.rc_context(figure.STYLE):
            return {line.get_label() for line in figure.draw_time_series(found).axes[1].get_lines()}

    found = [trial(number) for number in range(4)]
    assert not [label for label in labels(found) if 'other end' in label]
    found.append(trial(4, ending=TrialEnding.OTHER))
    assert [label for label in labels(found) if 'other end' in label] == ['other end, with oracle']


def row(seed, ending, **fields):
    return TrialRow('task', 'default', 0, seed, ending, **fields)


def test_rows_of_an_experiment_keep_such_an_end_and_the_judge_alone_says_what_it_is(tmp_path):
    rows = [row(1, 'other'), row(2, 'other', true_success=True), row(3, 'success')]
    rows += [
        row(4, 'other', true_success=True, wrong_object='cup'),
        row(5, 'other', true_success=False),
    ]
    append_rows(tmp_path / 'rows.csv', rows)
    assert read_rows(tmp_path / 'rows.csv') == rows
    assert [each.succeeded for each in rows] == [False, True, True, False, False]
    shares = {share.name: share.trials for share in comparison.shares_of(rows)}
    assert (shares['other end'], shares['true success'], shares['false success']) == (4, 2, 0)
    assert 'other end' in comparison.format_comparison(rows)
    assert 'other end' not in comparison.format_comparison([row(3, 'success')])
    assert 'other end' in format_tables(rows) and 'other end' not in format_tables(rows[2:3])


def test_the_progress_of_an_experiment_names_them():
    found = [trial(0), trial(1, ending=TrialEnding.OTHER)]
    assert describe_trials(found, False) == '0 failed, 1 with another end'
    assert describe_trials(found[:1], False) == '0 failed'


class Parker(FakeMachine):
    """Ends in `parked`, and names the rule where it has one."""

    def __init__(self, tell, rule, **settings):
        super().__init__(tell, **settings)
        self._rule = rule

    def run(self, seed, trial_id=''):
        self._trial_id, self._seq = trial_id, 0
        named = {} if self._rule is None else {RULE: self._rule.as_data()}
        self.emit(EventKind.TRIAL_START, data=dict({'recovers': True}, **named))
        self.emit(EventKind.TRIAL_END, outcome='parked')
        self.time += 60.0
        return 'parked'


@pytest.fixture(name='parked')
def record_parked(tmp_path):
    """Record trials that end in `parked`, one for each rule. Returns the folder."""

    def record(*rules):
        recorder = TrialRecorder(str(tmp_path / 'bags'), warn=pytest.fail)
        for number, rule in enumerate(rules):
            Parker(recorder, rule).run(number, 'trial-{}'.format(number))
        assert recorder.close(30.0)
        return str(tmp_path / 'bags')

    return record


def test_a_folder_that_mixes_rules_is_told_so_once_and_counted_by_each(parked, capsys):
    folder = parked(BY_NAME, BY_NAME, FailureRule(('parked',)), None)
    assert bag_statistics.main([folder]) == 0
    text = capsys.readouterr().out
    assert text.count('different rules') == 1
    told = [line.split() for line in text.split('different rules')[1].splitlines()[1:]]
    assert told == [
        ['1', 'by', 'a', 'list:', 'aborted,', 'failed,', 'failure,', 'error'],
        ['1', 'by', 'a', 'list:', 'parked'],
        ['2', 'by', 'name,', 'version', '1'],
    ]
    endings = sorted(each.ending.value for each in load_trials([folder]).trials)
    assert endings == ['failure', 'other', 'other', 'success']


def test_of_one_rule_nothing_is_said_and_a_rule_on_the_command_line_is_for_all(parked, capsys):
    folder = parked(BY_NAME, BY_NAME)
    assert bag_statistics.main([folder]) == 0
    assert 'rules' not in capsys.readouterr().out
    assert bag_statistics.main([folder, '--failing-outcomes', 'parked']) == 0
    text = capsys.readouterr().out
    assert '2 (100.0%)' in text and 'ther end' not in text


def test_a_later_version_of_the_rule_is_counted_by_the_one_that_is_known_and_told(parked, capsys):
    assert bag_statistics.main([parked(FailureRule(None, 7))]) == 0
    text = capsys.readouterr().out
    assert 'by name, version 7 (not known here: counted as version 1)' in text
    assert 'other end' in text
