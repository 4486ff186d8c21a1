"""Trials in which nothing fails: run once, counted for every variant, and no longer once one goes
otherwise.
"""

import contextlib
import json

import pytest

from smach_oracle.analysis.bag_events import RecordedCause
from smach_oracle.analysis.trial_rows import read_rows
from smach_oracle.analysis.trial_steps import steps_of
from smach_oracle.experiment import job as job_module
from smach_oracle.experiment import pool, sharing
from smach_oracle.experiment.plan import ExperimentError, ExperimentPlan, named_variants
from smach_oracle.experiment.sharing import (
    CleanTrial,
    difference,
    is_run_again,
    outcomes_of,
    world_seconds,
)
from smach_oracle.msg import TrialCause
from smach_oracle.oracle.records.events import Event, EventKind, EventSource, FailureKind
from smach_oracle.ros.recorder import TrialRecorder

SEED, TRIALS = 100, 8
FAILING = {102, 105}  # seeds of trials in which a state fails
AGAIN = {103}  # of those that are run again
ARMS = ('restart', 'one_line:prose')


def clean_events(*more, outcome='succeeded', first='succeeded'):
    """The events of a trial of two states, A and B, with more of them before its end."""
    kinds = [
        dict(kind=EventKind.TRIAL_START),
        dict(kind=EventKind.CONTAINER_START, state='A'),
        dict(kind=EventKind.STATE_START, state='A'),
        dict(kind=EventKind.TRANSITION, state='A', outcome=first, target='B'),
        dict(kind=EventKind.STATE_START, state='B'),
        dict(kind=EventKind.TRANSITION, state='B', outcome='succeeded', target=outcome),
        *more,
        dict(kind=EventKind.CONTAINER_END, outcome=outcome),
        dict(kind=EventKind.TRIAL_END, outcome=outcome),
    ]
    return [
        Event(trial_id='t', seq=number, wall_time=0.0, **{'path': 'TOP', **each})
        for number, each in enumerate(kinds)
    ]


def test_a_trial_in_which_nothing_fails_is_told_by_its_states_and_their_outcomes():
    assert outcomes_of(clean_events()) == (('A', 'succeeded'), ('B', 'succeeded'))
    assert outcomes_of(clean_events(first='found_nothing')) == (
        ('A', 'found_nothing'),
        ('B', 'succeeded'),
    )


@pytest.mark.parametrize(
    'events',
    [
        clean_events(first='aborted'),  # its author handles it
        clean_events(first='graspFailed'),
        clean_events(first='preempted'),
        clean_events(outcome='aborted'),
        clean_events(outcome='parked'),  # nobody knows whether that is a success
        clean_events(dict(kind=EventKind.FAILURE, state='B', failure_kind=FailureKind.EXCEPTION)),
        clean_events(dict(kind=EventKind.PRECONDITION_START, state='B')),
        clean_events(dict(kind=EventKind.WARNING, text='it is slow')),
        clean_events(dict(kind=EventKind.STATE_START, path='TOP/BELOW', state='C')),
        clean_events()[:-1],
        clean_events()[:3] + clean_events()[4:],
        clean_events(dict(kind=EventKind.TRANSITION, state='B', outcome='ok', text='not counted')),
    ],
    ids=str,
)
def test_what_is_more_than_the_way_from_state_to_state_is_not_shared(events):
    assert outcomes_of(events) is None


def test_a_tenth_is_run_again_and_the_seed_alone_draws_it():
    drawn = [seed for seed in range(5000) if is_run_again(seed)]
    assert 400 < len(drawn) < 600 and drawn == [s for s in range(5000) if is_run_again(s)]


TRUTH = {'seed': 1, 'success': True, 'sim_s': 20.0, 'wall_s': 3.0, 'share': {}, 'clock_s': 1.0}


@pytest.mark.parametrize(
    'truth, events, told',
    [
        (TRUTH, clean_events(), ''),
        ({**TRUTH, 'wall_s': 9.0, 'clock_s': 7.0, 'pauses': []}, clean_events(), ''),
        ({**TRUTH, 'sim_s': 20.1}, clean_events(), 'sim_s 20.0 and 20.1'),
        ({**TRUTH, 'damage': {'dropped': ['cup']}}, clean_events(), 'damage None and'),
        (TRUTH, clean_events(first='found'), 'step 4: '),
        (TRUTH, clean_events()[:-1], '8 and 7 steps'),
    ],
)
def test_one_difference_in_anything_but_the_machines_time_is_told(truth, events, told):
    clean = CleanTrial(
        RecordedCause(1, 't', (), ()), (), 'succeeded', steps_of(clean_events()), TRUTH, 20.0
    )
    assert difference(clean, events, truth).startswith(told)
    assert bool(difference(clean, events, truth)) == bool(told)


def test_a_shared_trial_takes_the_time_of_the_world_without_its_pauses():
    truth = {**TRUTH, 'clock_s': 10.0, 'pauses': [[12.0, 30.0], [60.0, 5.0]]}
    assert world_seconds([11.0, 50.0, 61.0], truth) == 19.0
    assert world_seconds([11.0, 50.0, 61.0], TRUTH) == 50.0


class FakeLaunch:
    """In place of roslaunch: records bags and tells truths as a world and a task would. It stops,
    as if the machine were switched off, before the trials of `dies_before`.
    """

    ran = []  # variant and seed
    replayed = []
    dies_before = set()
    otherwise = set()  # variant and seed of trials that go otherwise than others

    def __init__(self, folder, launch_file, arguments, core=None):
        self.folder, self.variant = folder, folder.parent.name
        rates = json.loads(arguments['oracle'])['rates_file']
        self.results = self._results_in(rates)
        shared = {}
        if 'shared' in arguments:
            content = json.loads(arguments['shared'].read_text(encoding='utf-8'))
            shared = {each['seed']: each for each in content}
        for seed in range(arguments['seed'], arguments['seed'] + arguments['trials']):
            if (self.variant, seed) in FakeLaunch.dies_before:
                raise KeyboardInterrupt
            (FakeLaunch.replayed if seed in shared else FakeLaunch.ran).append((self.variant, seed))
            fails = seed in FAILING
            self.results += 'f' * fails + 's' * (not fails or self.variant != 'bare')
            self._record(seed, fails)
            self._tell(shared[seed]['truth'] if seed in shared else self._truth(seed))

    def _results_in(self, rates):
        try:
            with open(rates, encoding='utf-8') as source:
                return json.load(source)['containers']['']['A']['results']
        except FileNotFoundError:
            return ''

    def _record(self, seed, fails):
        recorder = TrialRecorder(str(self.folder), warn=pytest.fail)
        source = EventSource(pytest.fail)
        cause = TrialCause(seed=seed, task='pick_and_place', kinds=[], details=[])
        recorder.attach(source, {'/world/cause': lambda: cause})
        source.begin_trial('{}-{}'.format(self.variant, seed))
        for event in clean_events()[:-2]:
            if fails and event.kind == EventKind.TRANSITION and event.state == 'B':
                source.emit(EventKind.FAILURE, 'TOP', state='B', outcome='aborted', failure_kind=1)
            source.emit(event.kind, 'TOP', None, event.state, event.outcome, event.target)
        lost = fails and self.variant == 'bare'
        source.emit(
            EventKind.TRIAL_END,
            'TOP',
            outcome='aborted' if lost else 'succeeded',
            data={'learned': {'': {'A': {'results': self.results}}}},
        )
        assert recorder.close(20.0)

    def _truth(self, seed):
        return {
            'seed': seed,
            'task': 'pick_and_place',
            'success': seed not in FAILING or self.variant != 'bare',
            'why': '',
            'causes': [],
            'sim_s': 21.0 if (self.variant, seed) in FakeLaunch.otherwise else 20.0,
            'wall_s': 5.0,
            'share': {},
        }

    def _tell(self, truth):
        with (self.folder / 'truth.jsonl').open('a') as file:
            file.write(json.dumps(truth) + '\n')

    def running(self):
        return False

    def request_stop(self):
        pass

    stop = request_stop


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run the bare script and two variants, and return the rows by variant and seed."""
    monkeypatch.setattr(job_module, 'Launch', FakeLaunch)
    monkeypatch.setattr(pool, 'POLL_S', 0.0)
    monkeypatch.setattr(job_module, 'is_run_again', lambda seed: seed in AGAIN)

    def run_all(shares=True, hours=None, otherwise=(), dies_before=(), at_a_time=2, folder='here'):
        FakeLaunch.ran, FakeLaunch.replayed = [], []
        FakeLaunch.otherwise, FakeLaunch.dies_before = set(otherwise), set(dies_before)
        plan = ExperimentPlan(
            'pick_and_place',
            TRIALS,
            SEED,
            1,
            named_variants(['restart', 'bare', 'one_line:prose'], {}),
            15.0,
            hours=hours,
            shares=shares,
        )
        (tmp_path / folder).mkdir(exist_ok=True)
        with pytest.raises(KeyboardInterrupt) if dies_before else contextlib.nullcontext():
            pool.run(plan, tmp_path / folder, at_a_time, 900.0)
        rows = read_rows(tmp_path / folder / 'results.csv') if not dies_before else []
        return {(row.variant, row.seed): row for row in rows}

    return run_all


def seeds_of(trials, variant):
    return [seed for name, seed in trials if name == variant]


def results_of(rows, variant):
    return [json.loads(rows[variant, SEED + n].learned)['']['A']['results'] for n in range(TRIALS)]


@pytest.mark.parametrize('at_a_time', [1, 3])
def test_what_does_not_fail_is_run_once_and_counts_for_every_variant(run, at_a_time):
    rows = run(at_a_time=at_a_time)
    assert len(rows) == 3 * TRIALS
    assert seeds_of(FakeLaunch.ran, 'bare') == list(range(SEED, SEED + TRIALS))
    for variant in ARMS:
        assert seeds_of(FakeLaunch.ran, variant) == sorted(FAILING | AGAIN)
        shared = {seed for name, seed in rows if name == variant and rows[name, seed].shared}
        assert shared == set(range(SEED, SEED + TRIALS)) - FAILING - AGAIN
        assert all(row.succeeded for (name, _), row in rows.items() if name == variant)
        assert results_of(rows, variant) == [
            's',
            'ss',
            *(2 * 's' + 'fs' + n * 's' for n in (0, 1, 2)),
        ] + ['ssfsssfs' + n * 's' for n in (0, 1, 2)]


def test_what_a_variant_learns_is_what_it_learns_where_nothing_is_shared(run):
    apart = run(shares=False)
    assert FakeLaunch.replayed == []
    rows = run(folder='another')
    assert {key: row._replace(shared=False) for key, row in rows.items()} == apart
    assert all(results_of(rows, name) == results_of(apart, name) for name in ARMS)


@pytest.mark.parametrize('seed', range(SEED, SEED + TRIALS))
def test_stopped_anywhere_it_goes_on_as_if_nothing_had_happened(run, seed):
    run(dies_before={('restart', seed)})
    rows = run()
    replayed = set(seeds_of(FakeLaunch.replayed, 'restart'))
    assert replayed == {each for each in range(seed, SEED + TRIALS)} - FAILING - AGAIN
    assert run(folder='another') == rows


def test_where_one_goes_otherwise_each_variant_runs_all_that_it_has_shared(run, tmp_path, capsys):
    rows = run(otherwise={('one_line:prose', 103)})
    assert 'one_line:prose/replicate_0: seed 103 went otherwise than under bare: sim_s' in (
        capsys.readouterr().out
    )
    assert not any(row.shared for row in rows.values()) and len(rows) == 3 * TRIALS
    for variant in ARMS:
        assert set(seeds_of(FakeLaunch.ran, variant)) == set(range(SEED, SEED + TRIALS))
    # and that stays so
    again = run()
    assert again == rows and FakeLaunch.ran == FakeLaunch.replayed == []
    assert 'seed 103' in json.loads((tmp_path / 'here' / sharing.ENDED_FILE).read_text())['why']


def test_stopped_after_the_sharing_has_ended_it_goes_on_without_it(run, tmp_path):
    run(dies_before={('restart', 106)})
    (tmp_path / 'here' / sharing.ENDED_FILE).write_text('{"why": "one went otherwise"}')
    rows = run()
    assert not any(row.shared for row in rows.values()) and len(rows) == 3 * TRIALS
    assert FakeLaunch.replayed == []


def test_nothing_is_shared_where_the_world_goes_on(run):
    run(shares=True, hours=2.0)
    assert FakeLaunch.replayed == []
    assert seeds_of(FakeLaunch.ran, 'restart') == list(range(SEED, SEED + TRIALS))


def without_bags(folder):
    for bag in (folder / 'here/bare').rglob('*.bag'):
        bag.unlink()


def test_without_the_bags_of_the_bare_script_its_trials_are_shared_as_they_were_kept(run, tmp_path):
    run(dies_before={('restart', SEED), ('one_line:prose', SEED)})
    without_bags(tmp_path)
    rows = run()
    assert seeds_of(FakeLaunch.ran, 'bare') == []
    assert seeds_of(FakeLaunch.ran, 'restart') == sorted(FAILING | AGAIN)
    assert run(folder='another') == rows


def test_what_was_kept_is_compared_as_well(run, tmp_path, capsys):
    run(dies_before={('restart', SEED), ('one_line:prose', SEED)})
    without_bags(tmp_path)
    rows = run(otherwise={('restart', 103)})
    assert 'seed 103 went otherwise' in capsys.readouterr().out
    assert not any(row.shared for row in rows.values())


def test_without_what_was_kept_each_variant_runs_its_trials(run, tmp_path):
    run(dies_before={('restart', SEED), ('one_line:prose', SEED)})
    without_bags(tmp_path)
    (tmp_path / 'here/bare/replicate_0' / sharing.CLEAN_FILE).unlink()
    run()
    assert FakeLaunch.replayed == [] and seeds_of(FakeLaunch.ran, 'bare') == []


@pytest.mark.parametrize('text', ['{', '{"seed": 1}', '7', '{"seed": "x", "task": 1, "kinds": []}'])
def test_trials_that_were_kept_and_cannot_be_read_are_named(run, tmp_path, text):
    run(dies_before={('restart', SEED), ('one_line:prose', SEED)})
    (tmp_path / 'here/bare/replicate_0' / sharing.CLEAN_FILE).write_text(text + '\n')
    with pytest.raises(ExperimentError, match='clean_trials.jsonl: no trials to share: '):
        run()
