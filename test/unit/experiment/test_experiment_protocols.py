"""Experiments of several parts: what they consist of, and how they are run and gone on with."""

import contextlib
import io
import json
from types import SimpleNamespace

import pytest

from smach_oracle.analysis.drawing import looks
from smach_oracle.analysis.trial_rows import TrialRow, append_rows, read_rows
from smach_oracle.experiment import command, pool, protocol_run
from smach_oracle.experiment.estimate import JobWork, duration, seconds_left
from smach_oracle.experiment.freeze import BLOCK, BLOCKS, Freeze
from smach_oracle.experiment.plan import ExperimentError
from smach_oracle.experiment.progress import PoolProgress
from smach_oracle.experiment.protocols import (
    ALL,
    COMPARED,
    MEMORIES,
    OTHERS,
    ProtocolChoice,
    parts_of,
)
from smach_oracle.experiment.stop_signals import StopRequested
from smach_oracle.oracle.decision.policies import POLICIES

TASKS = ('pick_and_place', 'drink_retrieval')


def by_name(protocol=ALL, **choice):
    seeds = choice.pop('seeds', dict.fromkeys(BLOCKS, 700))
    return {
        part.name: part.plan for part in parts_of(protocol, ProtocolChoice(seeds, 15.0, **choice))
    }


def names_of(plan):
    return [variant.name for variant in plan.variants]


def test_the_main_protocol_has_the_replicates_and_trials_that_it_should_have():
    compared = {name: plan for name, plan in by_name('main').items() if name.endswith('_compared')}
    assert {name: (plan.replicates, plan.trials) for name, plan in compared.items()} == {
        'pick_and_place_compared': (3, 150),
        'drink_retrieval_compared': (4, 100),
    }
    assert all(names_of(plan) == list(COMPARED) for plan in compared.values())


def test_every_policy_of_then_is_run_in_the_main_protocol_on_the_same_seeds():
    parts = by_name('main')
    for task in TASKS:
        ran = {
            name
            for part in ('compared', 'others')
            for name in names_of(parts['{}_{}'.format(task, part)])
        }
        # the default is prose, and later policies are not in this protocol
        assert ran == set(OTHERS) | set(COMPARED) and set(OTHERS) < set(POLICIES)
    assert {plan.seed for plan in parts.values()} == {700}


@pytest.mark.parametrize('task, trials', [('pick_and_place', 100), ('drink_retrieval', 60)])
def test_the_sweeps_have_a_part_for_each_share_and_a_variant_for_each_memory(task, trials):
    parts = by_name('persistence')
    shares = {
        parts['{}_persistence_{}'.format(task, share)].lasting: share for share in (0, 50, 100)
    }
    assert shares == {0.0: 0, 0.5: 50, 1.0: 100}
    assert all(names_of(plan) == list(COMPARED) for plan in parts.values())
    memory = by_name('memory')[task + '_memory']
    assert [variant.settings for variant in memory.variants] == [
        {'memory': number} for number in MEMORIES
    ]
    assert {
        plan.trials
        for name, plan in {**parts, **by_name('memory')}.items()
        if name.startswith(task)
    } == {trials} and memory.replicates == 1


def test_continuous_operation_takes_the_hours_of_the_paper_and_fewer_for_fewer_trials():
    assert {plan.task: (plan.trials, plan.hours) for plan in by_name('continuous').values()} == {
        'pick_and_place': (150, 20.0),
        'drink_retrieval': (100, 16.0),
    }
    fewer = by_name('continuous', trials=50)
    assert fewer['pick_and_place_continuous'].hours == pytest.approx(20 / 3)
    assert fewer['drink_retrieval_continuous'].hours == 8.0


def test_the_seeds_of_a_freeze_go_to_their_parts(monkeypatch, tmp_path):
    freeze = Freeze('c0ffee', 'abc', 2_000_000)
    monkeypatch.setattr(protocol_run, 'checkout', lambda: tmp_path)
    monkeypatch.setattr(protocol_run, 'last_freeze', lambda root: freeze)
    monkeypatch.setattr(protocol_run, 'frozen_seeds', lambda root: freeze)
    args = command.parse(['--protocol', 'all', '--frozen'])
    found = {}
    for part in protocol_run.chosen_parts(args):
        found.setdefault((part.plan.seed - 2_000_000) // BLOCK, []).append(part.name)
    assert [found[number][0] for number in range(5)] == [
        'pick_and_place_compared',
        'drink_retrieval_compared',
        'drink_retrieval_persistence_0',
        'drink_retrieval_memory',
        'drink_retrieval_continuous',
    ]
    assert len(found) == 5
    monkeypatch.setattr(
        protocol_run, 'frozen_seeds', lambda root: freeze._replace(first_seed=3_000_000)
    )
    with pytest.raises(ExperimentError, match='not what was frozen at commit c0ffee'):
        protocol_run.chosen_parts(args)


def test_variants_tasks_and_numbers_are_chosen_by_options():
    parts = protocol_run.chosen_parts(
        command.parse(
            [
                '--protocol',
                'all',
                '--task',
                'drink_retrieval',
                '--variants',
                'prose',
                'ladder',
                '--trials',
                '2',
                '--replicates',
                '1',
                '--seed',
                '9',
            ]
        )
    )
    assert [part.name for part in parts] == [
        'drink_retrieval_' + each
        for each in (
            'compared',
            'persistence_0',
            'persistence_50',
            'persistence_100',
            'memory',
            'continuous',
        )
    ]
    assert {(part.plan.trials, part.plan.replicates, part.plan.seed) for part in parts} == {
        (2, 1, 9)
    }
    assert names_of(parts[0].plan) == ['prose', 'ladder']


@pytest.mark.parametrize(
    'argv',
    [
        ['--protocol', 'guess'],
        ['--frozen'],
        ['--protocol', 'main', '--benign'],
        ['--protocol', 'main', '--lasting', '0.5'],
        ['--protocol', 'main', '--variants', 'with'],
        ['--protocol', 'memory', '--memory', '5'],
        ['--lasting', '1.5'],
        ['--hours', '0'],
    ],
)
def test_wrong_options_end_with_usage(argv, capsys):
    with pytest.raises(SystemExit) as ended:
        command.parse(argv)
    assert ended.value.code == 2 and 'usage' in capsys.readouterr().err


class FakeRunner:
    """In place of a job: a trial an observation, one row each, without ROS; it is stopped, and
    breaks, as told.
    """

    breaks = ()  # parts of names of jobs that break
    stop_after = 1000  # trials, after which somebody presses Ctrl-C
    started, ended = [], 0

    def __init__(self, plan, variant, replicate, output, hung_after_s, cluster):
        self.name = '{}/replicate_{}'.format(variant.name, replicate)
        self.variant, self.trials, self.lost, self.messages = variant, plan.trials, {}, []
        self._plan, self._replicate, self._rows = plan, replicate, output / 'results.csv'
        kept = read_rows(self._rows) if self._rows.exists() else []
        self.finished = sum(
            (row.variant, row.replicate) == (variant.name, replicate) for row in kept
        )
        self.running, self.ready = False, True

    def heed(self):
        pass

    @property
    def over(self):
        return self.finished >= self.trials

    def work(self):
        return JobWork(self._plan.task, self.trials - self.finished, [2.0] * self.finished)

    def start(self):
        self.running = True
        FakeRunner.started.append((self.name, self.finished))

    def watch(self):
        if any(each in self.name for each in self.breaks):
            raise ExperimentError(self.name + ': nothing has happened for 300 s')
        append_rows(
            self._rows,
            [
                TrialRow(
                    self._plan.task,
                    self.variant.name,
                    self._replicate,
                    self._plan.first_seed(self._replicate) + self.finished,
                    'success',
                    lasting_share=self._plan.lasting,
                    hour=None if self._plan.hours is None else float(self.finished),
                )
            ],
        )
        self.finished += 1
        FakeRunner.ended += 1

    def request_stop(self):
        pass

    def stop(self):
        self.running = False


class FakeSignals:
    """Ctrl-C, as often as FakeRunner says."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def check(self):
        if FakeRunner.ended >= FakeRunner.stop_after:
            raise StopRequested(2)


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run a protocol's command with fake runners; returns its exit code and what it printed.

    It draws only if it is told to.
    """
    drawn = protocol_run.draw_all
    monkeypatch.setattr(pool, 'ExperimentJob', FakeRunner)
    monkeypatch.setattr(pool, 'StopSignals', FakeSignals)
    monkeypatch.setattr(pool, 'POLL_S', 0.0)
    monkeypatch.setattr(command.shutil, 'which', lambda name: '/bin/' + name)

    def run_command(*options, breaks=(), stop_after=1000, draws=False):
        monkeypatch.setattr(protocol_run, 'draw_all', drawn if draws else lambda *_: [])
        FakeRunner.breaks, FakeRunner.stop_after = breaks, stop_after
        FakeRunner.started, FakeRunner.ended = [], 0
        told = io.StringIO()
        with contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
            code = command.main(
                [
                    '--protocol',
                    'all',
                    '--trials',
                    '2',
                    '--seed',
                    '7',
                    '--output',
                    str(tmp_path),
                    *options,
                ]
            )
        return code, told.getvalue()

    return run_command


def test_all_parts_are_run_in_one_pool_with_a_folder_each(run, tmp_path):
    code, told = run('--jobs', '3')
    names = list(by_name(trials=2))
    assert code == 0 and len(names) == 14
    for name in names:
        settings = json.loads((tmp_path / name / 'experiment.json').read_text())['settings']
        assert (settings['seed'], settings['trials']) == (7, 2)
    rows = [row for name in names for row in read_rows(tmp_path / name / 'results.csv')]
    assert len(rows) == FakeRunner.ended == 2 * len(FakeRunner.started)
    assert {row.lasting_share for row in rows} == {None, 0.0, 0.5, 1.0}
    kinds = ['drink_retrieval' in name for name, _ in FakeRunner.started]
    assert kinds == sorted(kinds, reverse=True), 'the longest come first'


def test_the_one_command_compares_all_variants_and_draws_figures_and_tables(run, tmp_path):
    code, told = run('--jobs', '3', draws=True)
    assert code == 0
    for name in ('bare', 'restart', 'ladder', 'always_ask'):
        assert 'person needed, default against {}: '.format(name) in told
    names = {path.name for path in (tmp_path / 'figures').iterdir()}
    assert names == {'tables.md'} | {
        stem + end
        for stem in ('main', 'same_seeds', 'persistence', 'memory', 'continuous')
        for end in ('.svg', '.png')
    }
    assert '| default against ladder | 2 |' in (tmp_path / 'figures' / 'tables.md').read_text()
    assert str(tmp_path / 'figures' / 'tables.md') in told


def test_trials_are_kept_where_figures_cannot_be_drawn(run, monkeypatch):
    def without(stem, output):
        raise ModuleNotFoundError("No module named 'matplotlib'", name='matplotlib')

    monkeypatch.setattr(looks, 'save', without)
    code, told = run('--jobs', '3', draws=True)
    assert code == 0 and 'Figures were not drawn: ' in told and 'matplotlib' in told
    assert 'Rows, bags and logs' in told and 'default against bare' in told


def test_the_limit_of_a_hung_trial_is_printed_and_kept(run, tmp_path):
    told = run('--jobs', '3', stop_after=5)[1]
    assert 'hung after 900 s without an event, or 4500 s in all' in told
    assert 'hung after 60 s' in run('--jobs', '3', '--hung-after', '60', stop_after=5)[1]
    run('--jobs', '3', '--hung-after', '60', stop_after=5)
    for name in ('pick_and_place_compared', 'drink_retrieval_memory'):
        content = json.loads((tmp_path / name / 'experiment.json').read_text())
        assert content['hung_after_s'] == [900.0, 60.0]


def test_stopped_it_goes_on_where_it_was(run, tmp_path):
    code, told = run('--jobs', '2', stop_after=21)
    assert code == 130 and 'stopped by SIGINT' in told
    done = FakeRunner.ended
    code, told = run('--jobs', '2')
    assert code == 0 and 'Going on in' in told
    rows = [row for path in tmp_path.glob('*/results.csv') for row in read_rows(path)]
    assert done + FakeRunner.ended == len(rows)
    assert len(
        {(row.task, row.variant, row.replicate, row.seed, row.lasting_share) for row in rows}
    ) < len(rows), 'main table and sweeps share variants'


def test_a_replicate_that_breaks_costs_no_other(run, tmp_path):
    code, told = run('--jobs', '2', breaks=('pick_and_place_compared/restart/replicate_1',))
    assert code == 1 and 'Replicates that were left' in told
    assert 'restart/replicate_1: nothing has happened' in told
    rows = read_rows(tmp_path / 'pick_and_place_compared' / 'results.csv')
    assert sorted({(row.variant, row.replicate) for row in rows}) == [
        (name, number)
        for name in ('bare', 'default', 'restart')
        for number in range(3)
        if (name, number) != ('restart', 1)
    ]
    code, told = run('--jobs', '2')
    assert code == 0 and [name for name, _ in FakeRunner.started] == [
        'pick_and_place_compared/restart/replicate_1'
    ], 'the same command tries it again'


def test_where_job_after_job_breaks_the_experiment_ends(run):
    code, told = run('--jobs', '2', breaks=('replicate',))
    assert code == 1 and 'nothing has happened' in told and len(FakeRunner.started) <= 4


def test_the_plan_tells_what_would_be_run_and_runs_nothing(run, tmp_path):
    run('--jobs', '2', stop_after=10)
    before = {path: path.read_bytes() for path in tmp_path.rglob('*') if path.is_file()}
    FakeRunner.started = []
    code, told = run('--jobs', '4', '--plan')
    assert code == 0 and not FakeRunner.started
    assert {path: path.read_bytes() for path in tmp_path.rglob('*') if path.is_file()} == before
    # 9 + 12 + 6 + 6 replicates compared and others, 18 of persistence, 10 of memory, 2 continuous
    done = sum(len(read_rows(path)) for path in tmp_path.glob('*/results.csv'))
    assert done >= 10 and '{} trials to run'.format(2 * 63 - done) in told
    assert 'at 4 jobs at a time' in told and 'pick_and_place_persistence_50' in told


def test_the_plan_of_one_experiment_needs_no_protocol(capsys):
    assert command.main(['--plan', '--trials', '30', '--variants', 'bare', 'restart']) == 0
    told = capsys.readouterr().out
    assert '60 trials to run' in told and 'bare restart' in told


def test_the_time_left_goes_by_what_trials_took_and_by_the_longest_job():
    works = [
        JobWork('pick_and_place', 10, [5.0, 7.0]),
        JobWork('pick_and_place', 10, []),
        JobWork('pick_and_place', 0, [6.0]),
    ]
    assert seconds_left(works, 1) == pytest.approx(2 * seconds_left(works, 2))
    assert seconds_left(works, 2) == seconds_left(works, 20), 'no job is split'
    assert seconds_left(works, 2) == pytest.approx(10 * 6.0, abs=20.0)
    assert seconds_left([works[2]], 2) == 0.0
    assert [duration(each) for each in (5.0, 119.0, 120.0, 3600.0, 11160.0)] == [
        '5 s',
        '119 s',
        '2 min',
        '1 h 00 min',
        '3 h 06 min',
    ]


def test_the_line_of_a_pool_counts_trials_and_replicates():
    stream = io.StringIO()
    job = SimpleNamespace(
        finished=3,
        trials=9,
        over=False,
        lost={5: 'hung'},
        messages=[],
        work=lambda: JobWork('pick_and_place', 6, [10.0]),
    )
    PoolProgress(stream, 2).show([job])
    assert stream.getvalue().startswith('3/9 trials, 0/1 replicates over, 1 lost   about ')


def test_the_fifth_protocol_has_parts_with_extra_causes_on_seeds_of_their_own():
    seeds = {name: BLOCK * number for number, name in enumerate(BLOCKS)}
    parts = by_name('fifth', seeds=seeds)
    for task, trials, block in (('pick_and_place', 40, 8), ('drink_retrieval', 30, 9)):
        part = parts[task + '_fifth_extra']
        assert (part.trials, part.replicates, part.seed) == (trials, 1, BLOCK * block)
        assert part.extra_causes and not part.shares
        assert names_of(part) == [
            'bare',
            'restart',
            'default',
            'one_line:escalating',
            'one_line:learned',
        ]
    tours = parts['inspection_fifth_extra']
    assert (tours.trials, tours.replicates, tours.seed) == (20, 1, BLOCK * 10)
    assert tours.extra_causes and not tours.shares
    assert names_of(tours) == ['bare', 'default', 'one_line:escalating', 'one_line:learned']
    usual = [plan for name, plan in parts.items() if not name.endswith('_extra')]
    assert not any(plan.extra_causes for plan in usual)


def test_the_blocks_of_before_are_where_they_were():
    assert BLOCKS[:8] == (
        'pick and place',
        'drink retrieval',
        'persistence',
        'memory',
        'continuous operation',
        'pick and place, extension',
        'drink retrieval, extension',
        'inspection',
    )


def test_a_plan_tells_of_extra_causes_where_it_has_them():
    usual, extra = (command.parse(['--task', TASKS[0], *more]).plan for more in ([], EXTRA))
    assert not usual.extra_causes and 'extra_causes' not in usual.as_data()
    assert extra.as_data() == {**usual.as_data(), 'extra_causes': True}


EXTRA = ['--extra-causes']


@pytest.mark.parametrize(
    'more',
    [['--benign'], ['--lasting', '0.5'], ['--hours', '2'], ['--protocol', 'main']],
)
def test_extra_causes_stand_alone(more, capsys):
    with pytest.raises(SystemExit) as ended:
        command.parse(['--task', TASKS[0], *EXTRA, *more])
    assert ended.value.code == 2 and '--extra-causes' in capsys.readouterr().err
