"""The folder of a job: what is kept of it after whatever interrupted it, and where it goes on."""

import json
from pathlib import Path
from typing import Mapping, Sequence

import pytest

from smach_oracle.analysis.trial_counter import TrialEnding
from smach_oracle.experiment.records import ReplicateRecords
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.oracle.records.facts import STOPPING, UNCOUNTED
from smach_oracle.ros.recorder import TrialRecorder

FIRST_SEED = 100


class RecordedJob:
    """A job's folder, filled as its launches would fill it."""

    def __init__(self, folder: Path, trials: int = 6) -> None:
        self.folder = folder
        self._trials = trials
        self.number = 0

    def tidy_up(self):
        return ReplicateRecords(self.folder, FIRST_SEED, self._trials).tidy_up()

    def record(
        self,
        *outcomes: str,
        start: int = 0,
        truth: bool = True,
        end: bool = True,
        last: Sequence[Mapping[str, object]] = (),
    ) -> None:
        """One trial for each outcome, from trial `start` on; `end`: whether they come to their
        ends; `last`: fields of events before that.
        """
        for trial, outcome in enumerate(outcomes, start):
            recorder = TrialRecorder(str(self.folder), warn=pytest.fail)
            source = EventSource(pytest.fail)
            recorder.attach(source)
            self.number += 1
            source.begin_trial('trial-{}'.format(self.number))
            source.emit(EventKind.TRIAL_START, 'TOP', data={'recovers': True})
            for fields in last:
                source.emit(**fields)
            if end:
                source.emit(
                    EventKind.TRIAL_END,
                    'TOP',
                    outcome=outcome,
                    data={'learned': self.learned(trial)},
                )
            assert recorder.close(20.0)
            if truth:
                self.tell(trial, outcome == 'succeeded')
        self.rates().write_text('{"of": "a trial under way"}')

    def tell(self, trial: int, success: bool) -> None:
        line = {
            'seed': FIRST_SEED + trial,
            'task': 't',
            'success': success,
            'why': '',
            'causes': [],
            'sim_s': 1.0,
            'wall_s': 1.0,
            'share': {},
        }
        with (self.folder / 'truth.jsonl').open('a') as file:
            file.write(json.dumps(line) + '\n')

    def learned(self, trial: int) -> dict:
        return {'': {'A': {'estimator': 'window', 'successes': trial, 'failures': 0, 'window': []}}}

    def rates(self) -> Path:
        return self.folder / 'rates.json'

    def kept_rates(self) -> dict:
        return json.loads(self.rates().read_text())['containers']

    def seeds_told(self) -> list:
        return [
            json.loads(line)['seed']
            for line in (self.folder / 'truth.jsonl').read_text().splitlines()
        ]


@pytest.fixture
def job(tmp_path: Path) -> RecordedJob:
    return RecordedJob(tmp_path / 'job')


def test_an_empty_job_begins_with_its_first_trial_and_no_rates(job: RecordedJob) -> None:
    assert job.tidy_up().next_trial == 0
    job.rates().write_text('{}')
    assert job.tidy_up().next_trial == 0 and not job.rates().exists()


def test_complete_trials_are_kept_with_the_rates_as_the_last_left_them(job: RecordedJob) -> None:
    job.record('succeeded', 'aborted', 'succeeded')
    progress = job.tidy_up()
    assert (progress.next_trial, progress.dropped, progress.lost) == (3, (), {})
    assert [trial.summary.ending for trial in progress.done] == [
        TrialEnding.SUCCESS,
        TrialEnding.FAILURE,
        TrialEnding.SUCCESS,
    ]
    assert job.kept_rates() == job.learned(2)


@pytest.mark.parametrize('how', [{'end': False}, {'truth': False}, {}])
def test_an_interrupted_trial_is_dropped_with_its_truth_and_its_rates(
    job: RecordedJob, how: dict
) -> None:
    job.record('succeeded', 'succeeded')
    job.record('succeeded' if how else 'preempted', start=2, **how)
    for _ in range(2):
        progress = job.tidy_up()
        assert (progress.next_trial, len(progress.done)) == (2, 2)
        assert job.kept_rates() == job.learned(1) and job.seeds_told() == [
            FIRST_SEED,
            FIRST_SEED + 1,
        ]
    job.record('aborted', start=2)  # run again
    assert job.tidy_up().next_trial == 3 and job.kept_rates() == job.learned(2)


@pytest.mark.parametrize(
    'last',
    [
        {'kind': EventKind.PREEMPT},
        {'kind': EventKind.TRANSITION, 'outcome': 'ok', 'target': 'succeeded', **STOPPING},
    ],
)
def test_a_trial_whose_last_state_ended_as_the_program_was_to_stop_is_run_again(
    job: RecordedJob, last: dict
) -> None:
    """It succeeded, and its rates lack what the last state would have taught."""
    job.record('succeeded')
    job.record('succeeded', start=1, last=[{'path': 'TOP', 'state': 'PLACE', **last}])
    progress = job.tidy_up()
    assert (progress.next_trial, len(progress.dropped)) == (1, 1)
    assert job.kept_rates() == job.learned(0) and job.seeds_told() == [FIRST_SEED]


@pytest.mark.parametrize(
    'last',
    [
        {'kind': EventKind.PREEMPT, 'path': 'TOP/IN'},
        {'kind': EventKind.TRANSITION, 'path': 'TOP', 'outcome': 'ok', **UNCOUNTED},
    ],
)
def test_one_in_which_a_part_was_preempted_or_not_counted_is_complete(
    job: RecordedJob, last: dict
) -> None:
    job.record('succeeded', last=[{'state': 'PLACE', **last}])
    assert job.tidy_up().next_trial == 1


def test_a_trial_that_was_ended_as_it_began_is_run_again(job: RecordedJob) -> None:
    """The shutdown came before its first state, and before the world told its seed."""
    job.record('succeeded', '')
    progress = job.tidy_up()
    assert (progress.next_trial, len(progress.done), len(progress.dropped)) == (1, 1, 1)
    assert job.seeds_told() == [FIRST_SEED]


def test_a_recorder_that_was_killed_leaves_a_trial_to_run_anew(job: RecordedJob) -> None:
    job.record('succeeded', 'succeeded', 'succeeded')
    bag = sorted(job.folder.glob('*.bag'))[1]
    bag.rename(str(bag) + '.active')
    progress = job.tidy_up()
    assert progress.next_trial == 1 and len(progress.dropped) == 2, (
        'what was learned after it does not count either'
    )
    assert job.kept_rates() == job.learned(0) and not list(job.folder.glob('*.active'))


def test_a_damaged_bag_is_run_anew(job: RecordedJob) -> None:
    job.record('succeeded', 'succeeded')
    bag = sorted(job.folder.glob('*.bag'))[1]
    bag.write_bytes(bag.read_bytes()[:200])
    assert job.tidy_up().next_trial == 1


def test_a_lost_trial_is_passed_over(job: RecordedJob) -> None:
    job.record('succeeded')
    ReplicateRecords(job.folder, FIRST_SEED, 6).mark_lost(1, 'hung')
    assert job.tidy_up().next_trial == 2
    job.record('succeeded', start=2)
    progress = job.tidy_up()
    assert (progress.next_trial, progress.lost) == (3, {1: 'hung'})
    assert job.seeds_told() == [FIRST_SEED, FIRST_SEED + 2]


def test_a_trial_that_was_lost_behind_a_damaged_one_is_run_again(job: RecordedJob) -> None:
    job.record('succeeded')
    ReplicateRecords(job.folder, FIRST_SEED, 6).mark_lost(1, 'hung')
    sorted(job.folder.glob('*.bag'))[0].write_bytes(b'')
    progress = job.tidy_up()
    assert (progress.next_trial, progress.lost) == (0, {})


def test_a_job_that_is_done_has_no_next_trial(job: RecordedJob) -> None:
    job.record(*['succeeded'] * 6)
    assert job.tidy_up().next_trial == 6
