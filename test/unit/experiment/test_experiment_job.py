"""A job and what can happen to its launches: trials that hang or die, what is tried again and what
is lost.
"""

from types import SimpleNamespace

import pytest

from smach_oracle.experiment import job as job_module
from smach_oracle.experiment.command import parse
from smach_oracle.experiment.job import ExperimentJob
from smach_oracle.experiment.launching import LOG_FILE
from smach_oracle.experiment.plan import ExperimentError
from smach_oracle.experiment.records import JobProgress

FIRST_SEED = 100


def recorded(path):
    return SimpleNamespace(summary=SimpleNamespace(bags=(path,), cause=None))


class FakeRecords:
    """Trials that are done by number, without any files."""

    def __init__(self, folder, first_seed, trials):
        self.folder, self.rates, self.truth = folder, folder / 'rates.json', folder / 'truth.jsonl'
        self._trials, self.takes_shared = trials, True
        self.done, self.lost = [], {}
        FakeLaunch.records = self

    def tidy_up(self, kept):
        left = [
            number
            for number in range(self._trials)
            if number not in self.done and number not in self.lost
        ]
        done = [recorded(path) for path in self.closed_bags()]
        return JobProgress(done, dict(self.lost), (), left[0] if left else self._trials)

    def closed_bags(self):
        return ['{}.bag'.format(number) for number in sorted(self.done)]

    def read(self, path):
        return recorded(path)

    def is_complete(self, trial):
        return False

    def with_truth(self, trial):
        return trial

    def mark_lost(self, number, why):
        self.lost[number] = why


class FakeLaunch:
    """Runs trials as told: by number of the launch, how many it completes and whether it then hangs
    or ends.
    """

    script = []
    started = []

    def __init__(self, folder, launch_file, arguments, core=None):
        self.arguments = arguments
        self.completes, self.hangs = FakeLaunch.script.pop(0)
        first = arguments['seed'] - FIRST_SEED
        FakeLaunch.records.done += range(first, first + min(self.completes, arguments['trials']))
        FakeLaunch.started.append(arguments)

    def running(self):
        return self.hangs

    def request_stop(self):
        self.hangs = False

    stop = request_stop


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run a job of six trials with launches that do as told; returns it, and how each launch was
    started.
    """

    def run_job(*script):
        FakeLaunch.script, FakeLaunch.started = list(script), []
        monkeypatch.setattr(job_module, 'Launch', FakeLaunch)
        monkeypatch.setattr(job_module, 'ReplicateRecords', FakeRecords)
        plan = parse(['--trials', '6', '--seed', str(FIRST_SEED), '--memory', '5']).plan
        # whatever runs on is hung
        job = ExperimentJob(plan, plan.variants[0], 0, tmp_path, hung_after_s=-1.0)
        job.start()
        while not job.over:
            job.watch()
        return job, [
            (arguments['seed'] - FIRST_SEED, arguments['trials'])
            for arguments in FakeLaunch.started
        ]

    return run_job


def test_a_launch_that_does_its_trials_is_the_only_one(run):
    job, started = run((6, False))
    assert started == [(0, 6)] and job.lost == {} and job.finished == 6
    arguments = FakeLaunch.started[0]
    assert arguments['with_oracle'] == 'true' and '"memory": 5' in arguments['oracle']
    assert 'rates.json' in arguments['oracle']


@pytest.mark.parametrize('hangs', [True, False])
def test_a_trial_that_hangs_or_dies_is_tried_once_more(run, hangs):
    job, started = run((2, hangs), (4, False))
    assert started == [(0, 6), (2, 4)] and job.lost == {}
    assert ('nothing has happened' if hangs else 'it ended before') in job.messages[0]
    assert job.messages[0].endswith('started again')


@pytest.mark.parametrize(
    'signs, why', [(4, 'nothing has happened for 100 s'), (6, 'no trial has ended for 500 s')]
)
def test_a_trial_that_goes_on_is_not_taken_for_hung_but_must_end_some_day(
    monkeypatch, tmp_path, signs, why
):
    now = [0.0]
    monkeypatch.setattr(job_module, 'time', SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(job_module, 'Launch', FakeLaunch)
    monkeypatch.setattr(job_module, 'ReplicateRecords', FakeRecords)
    FakeLaunch.script, FakeLaunch.started = [(0, True), (0, True)], []
    plan = parse(['--trials', '6', '--seed', str(FIRST_SEED)]).plan
    job = ExperimentJob(plan, plan.variants[0], 0, tmp_path, hung_after_s=100.0)
    folder = FakeLaunch.records.folder
    folder.mkdir(parents=True)
    job.start()
    for second in range(1, 506):
        now[0] = second
        if second % 99 == 0 and second <= 99 * signs:
            with (folder / LOG_FILE).open('a') as log:
                log.write('PICK began\n')
        job.watch()
        if job.messages:
            break
    assert why in job.messages[0] and now[0] == (99 * 4 + 101 if signs == 4 else 501)


def test_a_trial_that_hangs_twice_is_lost_and_the_next_one_begins(run):
    job, started = run((2, True), (0, True), (3, False))
    assert started == [(0, 6), (2, 4), (3, 3)]
    assert (
        list(job.lost) == [FIRST_SEED + 2]
        and job.messages[-1].endswith('LOST')
        and job.finished == 6
    )


def test_each_trial_has_its_own_second_attempt(run):
    job, started = run((1, True), (2, True), (3, False))
    assert started == [(0, 6), (1, 5), (3, 3)] and job.lost == {}


def test_a_job_that_cannot_even_begin_is_an_error(run):
    with pytest.raises(ExperimentError, match='seed 100: it ended before its trials were over'):
        run((0, False), (0, False))


def test_too_many_lost_trials_in_a_row_are_an_error(run):
    with pytest.raises(ExperimentError, match='seed 103'):
        run((1, True), *[(0, True)] * 6)


def test_where_trials_have_rows_alone_the_next_one_that_hangs_is_lost(run, monkeypatch):
    def tidy_up(records, kept):
        left = [
            number
            for number in range(2, 6)
            if number not in records.done and number not in records.lost
        ]
        return JobProgress(
            [recorded(path) for path in records.closed_bags()],
            dict(records.lost),
            (),
            left[0] if left else 6,
            kept=2,
        )

    monkeypatch.setattr(FakeRecords, 'tidy_up', tidy_up)
    job, started = run((0, True), (0, True), (3, False))
    assert started == [(2, 4), (2, 4), (3, 3)] and list(job.lost) == [FIRST_SEED + 2]
