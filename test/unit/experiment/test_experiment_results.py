"""The rows of an experiment: written as trials end, and gone on from without the bags."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from smach_oracle.analysis.bag_events import RecordedCause
from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.lasting.tries import StateTry
from smach_oracle.analysis.trial_rows import LOST, append_rows, read_rows
from smach_oracle.analysis.truth import Truth
from smach_oracle.experiment import job as job_module
from smach_oracle.experiment.command import parse
from smach_oracle.experiment.job import ExperimentJob
from smach_oracle.experiment.plan import ExperimentError
from smach_oracle.experiment.records import RecordedTrial, ReplicateRecords
from smach_oracle.experiment.results import RESULTS_FILE, JobResults
from smach_oracle.oracle.records.events import Event, EventKind

FIRST_SEED = 100


def learned(number):
    return {'': {'A': {'estimator': 'window', 'successes': number, 'failures': 0, 'window': []}}}


def trial(number, success=True):
    """A trial that has come to its end, with the truth on it."""
    outcome = 'succeeded' if success else 'aborted'
    trial_id = str(number)
    summary = summarise(
        [
            Event(EventKind.TRIAL_START, trial_id, 0, 1.0, 'TOP'),
            Event(EventKind.TRIAL_END, trial_id, 1, 2.0, 'TOP', outcome=outcome),
        ],
        ('/b/{}.bag'.format(number),),
    )
    seed = FIRST_SEED + number
    return RecordedTrial(
        summary._replace(
            cause=RecordedCause(seed, 'pick', ('glare',), ('light',)),
            truth=Truth(seed, 'pick', success, 'judged', (), 30.0, 9.0, {}),
        ),
        learned(number),
    )


@pytest.fixture
def results(tmp_path):
    """Opens the rows of a job in the test's folder."""
    return lambda variant='restart', replicate=0: JobResults(
        tmp_path, 'pick', variant, replicate, FIRST_SEED
    )


def test_a_row_is_written_once_and_tells_of_the_trial(results, tmp_path):
    job = results()
    job.add([trial(0), trial(1, False)], {}, tmp_path / 'none')
    job.add([trial(0), trial(1, False), trial(2)], {}, tmp_path / 'none')
    results().add([trial(1)], {}, tmp_path / 'none')
    rows = read_rows(tmp_path / RESULTS_FILE)
    assert [(row.seed, row.variant, row.ending, row.true_success) for row in rows] == [
        (100, 'restart', 'success', True),
        (101, 'restart', 'failure', False),
        (102, 'restart', 'success', True),
    ]
    assert (rows[0].causes, rows[0].why, rows[0].sim_s) == ('glare', 'judged', 30.0)
    assert json.loads(rows[2].learned) == learned(2)
    assert (tmp_path / RESULTS_FILE).read_text().count('\n') == 4


def test_what_the_truth_tells_beyond_the_end_is_in_the_row(results, tmp_path):
    truth = tmp_path / 'truth.jsonl'
    truth.write_text(
        '{"seed": 100, "wrong_object": "cup", "damage": {"dropped": ["cup"]}, '
        '"passed_s": {"expert": 20.5}}\n'
    )
    results().add([trial(0)], {}, truth)
    (row,) = read_rows(tmp_path / RESULTS_FILE)
    assert (row.wrong_object, row.damage, row.expert_s) == ('cup', 1, 20.5)
    assert not row.succeeded


def test_a_row_tells_the_worlds_log_and_the_tries_in_the_worlds_time(results, tmp_path):
    truth = tmp_path / 'truth.jsonl'
    truth.write_text(
        json.dumps(
            {
                'seed': 100,
                'causes': [
                    {
                        'kind': 'glare',
                        'text': 'low sun',
                        'lasting': True,
                        'began_s': 4.25,
                        'ended_s': None,
                    }
                ],
                'clock_s': 50.0,
                'pauses': [[55.0, 2.0]],
            }
        )
        + '\n'
    )
    told = trial(0)
    results().add(
        [
            told._replace(
                tries=(StateTry('PICK', 54.0, 60.0, 0), StateTry('PICK', 61.0, None, 1)),
                summary=told.summary._replace(settings=(('memory', 10), ('prior', 0.1))),
            )
        ],
        {},
        truth,
    )
    (row,) = read_rows(tmp_path / RESULTS_FILE)
    assert row.cause_log == '[["glare",true,4.25,null]]'
    assert row.tries == '[["PICK",4.0,8.0,0],["PICK",9.0,null,1]]'
    assert (row.memory, row.prior) == (10, 0.1)
    results('bare').add([trial(0)], {}, tmp_path / 'none')
    older = read_rows(tmp_path / RESULTS_FILE)[1]
    assert (older.cause_log, older.tries, older.memory) == ('', '', None), 'not known'


@pytest.mark.parametrize('questions, expert_s', [(0, 0.0), (2, None)])
def test_what_nobody_was_told_of_the_experts_time_is_not_known(
    results, tmp_path, questions, expert_s
):
    truth = tmp_path / 'truth.jsonl'
    truth.write_text('{"seed": 100, "passed_s": {"planning": 3.0}}\n')
    asked = trial(0)
    results().add([asked._replace(summary=asked.summary._replace(questions=questions))], {}, truth)
    assert read_rows(tmp_path / RESULTS_FILE)[0].expert_s == expert_s


def test_a_job_goes_on_behind_its_rows_with_the_rates_of_the_last(results, tmp_path):
    results().add([trial(0), trial(2)], {1: 'it hung'}, tmp_path / 'none')
    records = ReplicateRecords(tmp_path / 'job', FIRST_SEED, 6)
    progress = records.tidy_up(results().kept())
    assert (progress.next_trial, progress.kept, progress.lost) == (3, 2, {1: 'it hung'})
    assert json.loads(records.rates.read_text())['containers'] == learned(2)
    assert [row.ending for row in read_rows(tmp_path / RESULTS_FILE)] == [
        'success',
        'success',
        LOST,
    ]


def test_rows_behind_a_gap_do_not_count(results, tmp_path):
    results().add([trial(0), trial(2)], {}, tmp_path / 'none')
    assert results().kept().numbers == [0]


def test_rows_of_another_variant_or_replicate_are_none_of_the_job(results, tmp_path):
    results('bare').add([trial(0)], {}, tmp_path / 'none')
    results('restart', 1).add([trial(0)], {}, tmp_path / 'none')
    assert results().kept().numbers == []


def test_what_is_run_anew_is_written_anew(results, tmp_path):
    job = results()
    job.add([trial(0), trial(1)], {}, tmp_path / 'none')
    job.forget_from(1)
    job.add([trial(0), trial(1, False)], {}, tmp_path / 'none')
    assert [row.ending for row in read_rows(tmp_path / RESULTS_FILE)] == ['success', 'failure']


def test_trials_with_bags_come_behind_those_that_have_rows_alone(results, tmp_path, monkeypatch):
    results().add([trial(number) for number in range(4)], {}, tmp_path / 'none')
    records = ReplicateRecords(tmp_path / 'job', FIRST_SEED, 6)
    (records.folder / 'a.bag').touch()
    monkeypatch.setattr(records, 'read', lambda path: trial(2))
    (records.folder / 'truth.jsonl').write_text(
        json.dumps(
            {
                'seed': 102,
                'task': 't',
                'success': True,
                'why': '',
                'causes': [],
                'sim_s': 1.0,
                'wall_s': 1.0,
                'share': {},
            }
        )
        + '\n'
    )
    progress = records.tidy_up(results().kept())
    assert (progress.kept, len(progress.done), progress.next_trial) == (2, 1, 3)


@pytest.mark.parametrize('torn', ['a.bag', 'a.bag.active'])
def test_a_torn_bag_costs_no_row(results, tmp_path, torn):
    """Where a machine goes on from rows, its first trial may be cut off before it is closed."""
    results().add([trial(number) for number in range(3)], {}, tmp_path / 'none')
    records = ReplicateRecords(tmp_path / 'job', FIRST_SEED, 6)
    (records.folder / torn).touch()
    progress = records.tidy_up(results().kept())
    assert (progress.kept, progress.next_trial, progress.dropped) == (3, 3, (torn,))
    assert not list(records.folder.glob('*.active'))
    assert json.loads(records.rates.read_text())['containers'] == learned(2)


def test_a_torn_bag_before_others_costs_no_row(results, tmp_path, monkeypatch):
    results().add([trial(number) for number in range(4)], {}, tmp_path / 'none')
    records = ReplicateRecords(tmp_path / 'job', FIRST_SEED, 6)
    for name in ('a.bag', 'b.bag'):
        (records.folder / name).touch()
    monkeypatch.setattr(records, 'read', lambda path: trial(3) if path.endswith('b.bag') else None)
    (records.folder / 'truth.jsonl').write_text(
        json.dumps(
            {
                'seed': 103,
                'task': 't',
                'success': True,
                'why': '',
                'causes': [],
                'sim_s': 1.0,
                'wall_s': 1.0,
                'share': {},
            }
        )
        + '\n'
    )
    progress = records.tidy_up(results().kept())
    assert (progress.kept, len(progress.done), progress.next_trial) == (3, 1, 4)
    assert progress.dropped == ('a.bag',)


def test_rows_that_do_not_tell_the_rates_are_refused(results, tmp_path):
    append_rows(
        tmp_path / RESULTS_FILE,
        [read._replace(learned='') for read in _rows_of(results(), tmp_path)],
    )
    with pytest.raises(ExperimentError, match='restart, seed 100: .*what was learned'):
        results().kept()


def _rows_of(job, folder):
    job.add([trial(0)], {}, folder / 'none')
    return read_rows(folder / RESULTS_FILE)


def plan(*options):
    return parse(['--trials', '6', '--seed', str(FIRST_SEED), *options]).plan


def test_a_whole_job_goes_on_without_its_bags(tmp_path):
    arguments = ('--variants', 'bare', 'restart')
    variant = plan(*arguments).variants[1]
    JobResults(tmp_path, 'pick_and_place', 'restart', 0, FIRST_SEED).add(
        [trial(0), trial(1)], {}, tmp_path / 'none'
    )
    job = ExperimentJob(plan(*arguments), variant, 0, tmp_path, 300.0)
    assert (job.finished, job.over) == (2, False)
    told = job._arguments()
    assert (told['seed'], told['trials'], told['with_oracle']) == (102, 4, 'true')
    assert json.loads(told['oracle'])['policy'] == 'restart'


def test_the_share_of_lasting_causes_is_given_to_the_world_and_told_by_the_rows(tmp_path):
    given = plan('--variants', 'bare', '--lasting', '0.5')
    job = ExperimentJob(given, given.variants[0], 0, tmp_path, 300.0)
    assert job._arguments()['lasting'] == 0.5 and 'lab' not in job._arguments()
    job._results.add([trial(0)], {1: 'hung'}, tmp_path / 'none')
    assert [row.lasting_share for row in read_rows(tmp_path / RESULTS_FILE)] == [0.5] * 2
    usual = plan('--variants', 'bare')
    assert (
        'lasting'
        not in ExperimentJob(usual, usual.variants[0], 0, tmp_path / 'other', 300.0)._arguments()
    )


def test_extra_causes_are_asked_of_the_world_and_told_by_the_rows(tmp_path):
    given = plan('--variants', 'bare', '--extra-causes')
    job = ExperimentJob(given, given.variants[0], 0, tmp_path, 300.0)
    assert job._arguments()['extra_causes'] == 'true'
    job._results.add([trial(0)], {1: 'hung'}, tmp_path / 'none')
    assert [row.extra_causes for row in read_rows(tmp_path / RESULTS_FILE)] == [True] * 2
    usual = plan('--variants', 'bare')
    job = ExperimentJob(usual, usual.variants[0], 0, tmp_path / 'other', 300.0)
    assert 'extra_causes' not in job._arguments()


def test_a_world_that_goes_on_goes_on_as_the_last_row_tells(tmp_path, monkeypatch):
    given = plan('--variants', 'bare', '--hours', '3')
    truth = tmp_path / 'truth.jsonl'
    truth.write_text(
        ''.join(
            json.dumps(
                {
                    'seed': FIRST_SEED + number,
                    'hour': 0.5 * number,
                    'left': {'ended': 0.5 * number + 0.1},
                }
            )
            + '\n'
            for number in range(3)
        )
    )
    JobResults(tmp_path, 'pick_and_place', 'bare', 0, FIRST_SEED).add(
        [trial(0), trial(1)], {2: 'hung'}, truth
    )
    started = []
    monkeypatch.setattr(job_module, 'Launch', lambda *launched: started.append(launched))
    job = ExperimentJob(given, given.variants[0], 0, tmp_path, 300.0)
    job.start()
    ((_, _, arguments, _),) = started
    assert arguments['seed'] == FIRST_SEED + 3
    assert json.loads(Path(arguments['lab']).read_text()) == {
        'seed': FIRST_SEED,
        'slot_h': 0.5,
        'left': {'ended': 0.6},
    }, 'a lost trial leaves nothing'


def test_a_lost_trial_of_a_world_that_goes_on_has_its_hour(tmp_path):
    """One begins every half hour. The third took until hour 1.7, so the fourth was late."""
    truth = tmp_path / 'truth.jsonl'
    truth.write_text(
        ''.join(
            json.dumps({'seed': FIRST_SEED + number, 'hour': hour, 'left': {'ended': ended}}) + '\n'
            for number, hour, ended in ((0, 0.0, 0.1), (2, 1.0, 1.7))
        )
    )
    job = JobResults(tmp_path, 'pick_and_place', 'bare', 0, FIRST_SEED, None, 0.5)
    job.add([trial(0), trial(2)], {}, truth)
    job.add([], {1: 'hung', 3: 'hung'}, truth)
    hours = {row.seed - FIRST_SEED: row.hour for row in read_rows(tmp_path / RESULTS_FILE)}
    assert hours == {0: 0.0, 1: 0.5, 2: 1.0, 3: 1.7}
    given = plan('--variants', 'bare', '--hours', '3')
    whole = ExperimentJob(given, given.variants[0], 0, tmp_path / 'other', 300.0)
    whole._results.add([], {2: 'hung'}, truth)
    assert read_rows(tmp_path / 'other' / RESULTS_FILE)[0].hour == 1.0


@pytest.mark.parametrize('name', ['random', 'any_way'])
def test_what_is_drawn_is_that_of_the_trial_also_after_an_interruption(tmp_path, name):
    (variant,) = plan('--variants', name).variants
    JobResults(tmp_path, 'pick_and_place', name, 0, FIRST_SEED).add(
        [trial(0)], {}, tmp_path / 'none'
    )
    job = ExperimentJob(plan('--variants', name), variant, 0, tmp_path, 300.0)
    assert json.loads(job._arguments()['oracle'])['policy'] == {'name': name, 'seed': 101}


def test_variants_are_chosen_by_their_names():
    found = plan('--variants', 'bare', 'default', 'restart', '--max-recoveries', '3').variants
    assert [(each.name, each.recovers, dict(each.settings)) for each in found] == [
        ('bare', False, {}),
        ('default', True, {'max_recoveries': 3}),
        ('restart', True, {'max_recoveries': 3, 'policy': 'restart'}),
    ]
    swept = plan('--variants', 'bare', 'prose', '--memory', '2', '50').variants
    assert [each.name for each in swept] == ['bare', 'prose_memory_2', 'prose_memory_50']


@pytest.mark.parametrize(
    'options',
    [
        ['--variants', 'both', 'restart'],
        ['--variants', 'restart', '--policy', 'prose'],
        ['--variants', 'guess'],
        ['--arms', 'restart'],
    ],
)
def test_wrong_variants_end_with_usage(options, capsys):
    with pytest.raises(SystemExit) as ended:
        plan(*options)
    assert ended.value.code == 2 and 'usage' in capsys.readouterr().err


def test_a_job_without_git_has_no_version(monkeypatch):
    from smach_oracle.experiment import results as module

    def gone(*args, **more):
        raise OSError

    monkeypatch.setattr(
        module,
        'subprocess',
        SimpleNamespace(run=gone, CalledProcessError=ValueError, PIPE=-1, DEVNULL=-3),
    )
    assert module.code_version() == ''
