"""The experiment's own words and refusals; the experiment itself is run by the demo and a
rostest.
"""

import io
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Optional

import pytest

from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.experiment import launching
from smach_oracle.experiment.command import main, parse
from smach_oracle.experiment.launching import MARK, end_marked, environment_of, free_port, marked
from smach_oracle.experiment.plan import ExperimentError, enter_folder
from smach_oracle.experiment.pool import alone_in, stop_all
from smach_oracle.experiment.progress import ProgressLine, describe_trials, time_left
from smach_oracle.experiment.stop_signals import StopRequested, StopSignals
from smach_oracle.oracle.records.events import Event, EventKind

# as run_trials wrote it when variants were called arms
OLD_FOLDER = """{
 "format": "smach_oracle experiment",
 "settings": {
  "answer_delay": 15.0,
  "arms": [
   {"name": "with_oracle_memory_5", "recovers": true, "settings": {"memory": 5}},
   {"name": "with_oracle_memory_10", "recovers": true, "settings": {"memory": 10}},
   {"name": "without_oracle", "recovers": false, "settings": {}}
  ],
  "benign": false,
  "replicates": 1,
  "seed": 7,
  "task": "pick_and_place",
  "trials": 20
 },
 "software": {"python": "3.8.10"},
 "version": 1
}
"""


class FakeTerminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def fake_job(done: int) -> SimpleNamespace:
    return SimpleNamespace(
        variant=SimpleNamespace(name='with_oracle', recovers=True),
        trials=10,
        finished=done,
        lost={},
        summaries={},
        messages=[],
    )


@pytest.mark.parametrize(
    'argv',
    [
        ['--trials', '0'],
        ['--jobs', '0'],
        ['--seed', '-1'],
        ['--answer-delay', 'nan'],
        ['--task', 'dance'],
        ['--variants', 'three'],
        ['--arms', 'three'],
        ['--policy', 'nonsense'],
        ['--replicates', '0'],
        ['--memory', '10', '0'],
        ['--moderate-from', '0.9'],
        ['--hung-after', '0'],
    ],
)
def test_wrong_arguments_end_with_usage(argv: list, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as caught:
        parse(argv)
    assert caught.value.code == 2
    assert 'usage' in capsys.readouterr().err


@pytest.mark.parametrize(
    'argv, words',
    [
        (['--answer-delay', '4000'], '--answer-delay must be from 0 to 3600'),
        (['--answer-delay', '-1'], '--answer-delay must be from 0 to 3600'),
        (['--seed', '-1'], '--seed must be 0 or more'),
        (['--jobs', '0'], '--jobs must be 1 or more'),
    ],
)
def test_a_wrong_number_is_told_with_what_is_allowed(
    argv: list, words: str, capsys: pytest.CaptureFixture
) -> None:
    with pytest.raises(SystemExit):
        parse(argv)
    assert words in capsys.readouterr().err


def test_the_output_may_be_in_the_home_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('HOME', str(tmp_path))
    assert parse(['--output', '~/trials', '--answer-delay', '3600']).output == tmp_path / 'trials'


@pytest.mark.parametrize('more', [[], ['--plan']])
def test_a_file_in_place_of_the_folder_is_told_with_what_is_allowed(
    tmp_path: Path, more: list, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / 'trials.csv').write_text('mine')
    assert main(['--output', str(tmp_path / 'trials.csv'), *more]) == 1
    assert 'trials.csv: a file; allowed: a folder' in capsys.readouterr().err
    assert (tmp_path / 'trials.csv').read_text() == 'mine'


@pytest.mark.parametrize('task, trials', [('pick_and_place', 150), ('drink_retrieval', 100)])
def test_the_default_experiment_is_the_papers(task: str, trials: int) -> None:
    plan = parse(['--task', task]).plan
    assert (plan.trials, plan.replicates, [variant.name for variant in plan.variants]) == (
        trials,
        1,
        ['with_oracle', 'without_oracle'],
    )
    assert plan.variants[0].settings == {}, "the task's own"


def test_replicates_have_seeds_of_their_own_and_variants_the_same() -> None:
    plan = parse(['--trials', '20', '--seed', '7', '--replicates', '3']).plan
    assert [plan.first_seed(replicate) for replicate in range(3)] == [7, 27, 47]


def test_each_memory_and_policy_has_a_variant_of_its_own() -> None:
    variants = parse(
        ['--memory', '5', '10', '--policy', 'configured', 'algorithm1', '--high-from', '0.8']
    ).plan.variants
    assert [(variant.name, variant.settings) for variant in variants] == [
        ('with_oracle_policy_configured_memory_5', {'high_from': 0.8, 'memory': 5}),
        ('with_oracle_policy_configured_memory_10', {'high_from': 0.8, 'memory': 10}),
        (
            'with_oracle_policy_algorithm1_memory_5',
            {'high_from': 0.8, 'memory': 5, 'policy': 'algorithm1'},
        ),
        (
            'with_oracle_policy_algorithm1_memory_10',
            {'high_from': 0.8, 'memory': 10, 'policy': 'algorithm1'},
        ),
        ('without_oracle', {}),
    ]
    assert parse(['--memory', '5', '--variants', 'with']).plan.variants[0].name == 'with_oracle'


def test_the_older_name_of_an_option_works_and_warns(capsys: pytest.CaptureFixture) -> None:
    for which, names in (('with', ['with_oracle']), ('without', ['without_oracle'])):
        assert [variant.name for variant in parse(['--arms', which]).plan.variants] == names
        assert '--arms is now called --variants' in capsys.readouterr().err
    assert [variant.name for variant in parse(['--variants', 'without']).plan.variants] == [
        'without_oracle'
    ]
    assert capsys.readouterr().err == ''


def test_a_folder_from_before_variants_were_called_so_goes_on(tmp_path: Path) -> None:
    (tmp_path / 'experiment.json').write_text(OLD_FOLDER)
    argv = ['--trials', '20', '--seed', '7', '--memory', '5', '10']
    assert enter_folder(tmp_path, parse(argv).plan)
    with pytest.raises(
        ExperimentError, match='variants: there with_oracle_memory_5 .* without_oracle, now without'
    ):
        enter_folder(tmp_path, parse(argv + ['--variants', 'without']).plan)


def test_a_folder_goes_on_with_its_own_settings_alone(tmp_path: Path) -> None:
    plan = parse(['--trials', '20', '--memory', '5']).plan
    assert not enter_folder(tmp_path / 'new', plan)
    assert enter_folder(
        tmp_path / 'new', parse(['--trials', '20', '--memory', '5', '--jobs', '1']).plan
    )
    with pytest.raises(ExperimentError, match='trials: there 20, now 30'):
        enter_folder(tmp_path / 'new', parse(['--trials', '30', '--memory', '5']).plan)
    with pytest.raises(
        ExperimentError, match="there with_oracle {'memory': 5}, .*now with_oracle {'memory': 6}"
    ):
        enter_folder(tmp_path / 'new', parse(['--trials', '20', '--memory', '6']).plan)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / 'old.bag').touch()
    with pytest.raises(ExperimentError, match='not empty'):
        enter_folder(tmp_path, parse(['--trials', '300']).plan)
    (tmp_path / 'experiment.json').write_text('{"format": 1}')
    with pytest.raises(ExperimentError, match='no settings of an experiment'):
        enter_folder(tmp_path, parse(['--trials', '300']).plan)


def test_two_runs_do_not_work_in_one_folder(tmp_path: Path) -> None:
    with alone_in(tmp_path), pytest.raises(ExperimentError, match='another run_trials'), alone_in(
        tmp_path
    ):
        pass
    with alone_in(tmp_path):
        pass


def summary(*kinds: EventKind, outcome: str = 'succeeded'):
    events = [EventKind.TRIAL_START, *kinds, EventKind.TRIAL_END]
    return summarise(
        [
            Event(kind, 'id', number, 0.0, 'TOP', outcome=outcome, query_id='q')
            for number, kind in enumerate(events)
        ]
    )


def test_progress_tells_what_came_of_the_trials() -> None:
    trials = [
        summary(),
        summary(EventKind.FAILURE, outcome='aborted'),
        summary(EventKind.FAILURE, EventKind.QUERY_OPENED),
    ]
    assert describe_trials(trials, True) == '2 with failures, 0 recovered, 1 asked, 1 failed'
    assert describe_trials(trials, False) == '1 failed'


def test_time_left_is_told_only_while_there_is_some() -> None:
    assert [time_left(10.0, 0, 5), time_left(10.0, 5, 0)] == ['', '']
    assert [time_left(10.0, 5, 5), time_left(100.0, 5, 30)] == ['   10 s left', '   10 min left']


def test_progress_rewrites_its_line_on_a_terminal_and_spares_a_log() -> None:
    terminal, log = FakeTerminal(), io.StringIO()
    for stream in (terminal, log):
        progress = ProgressLine(stream)
        for done in (0, 0, 10):
            progress.show([fake_job(done)])
        progress.end()
    assert terminal.getvalue().count('\r') == 2
    assert log.getvalue() == 'with oracle 0/10\n'


def test_what_somebody_should_know_is_said_once_and_at_once() -> None:
    log, job = io.StringIO(), fake_job(0)
    job.messages.append('seed 5: hung')
    progress = ProgressLine(log)
    for _ in range(2):
        progress.show([job])
    assert log.getvalue() == 'seed 5: hung\nwith oracle 0/10\n'


@pytest.mark.parametrize('signum', StopSignals.SIGNALS)
def test_signals_are_kept_for_a_moment_at_which_they_can_do_no_harm(signum: int) -> None:
    before = signal.getsignal(signum)
    signal.signal(signum, signal.SIG_DFL)  # a hangup is ignored under nohup
    try:
        with StopSignals() as signals:
            signals.check()
            for again in (signum, signal.SIGINT):
                os.kill(os.getpid(), again)
            with pytest.raises(StopRequested) as caught:
                signals.check()
        assert caught.value.signum == signum
        assert signal.getsignal(signum) == signal.SIG_DFL
    finally:
        signal.signal(signum, before)


def test_a_hangup_that_nohup_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopSignals() as signals:
            os.kill(os.getpid(), signal.SIGHUP)
            signals.check()
            assert signal.getsignal(signal.SIGINT) != signal.SIG_IGN
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_job_that_cannot_be_settled_does_not_keep_the_others_running() -> None:
    stopped = []

    class Stopped:
        def __init__(self, error: Optional[Exception]) -> None:
            self.error = error

        def request_stop(self) -> None:
            stopped.append('asked')

        def stop(self) -> None:
            stopped.append('stopped')
            if self.error is not None:
                raise self.error

    with pytest.raises(OSError, match='disk full'):
        stop_all(
            [Stopped(OSError('disk full')), Stopped(ExperimentError('damaged')), Stopped(None)]
        )
    assert stopped == ['asked'] * 3 + ['stopped'] * 3


def test_a_job_is_alone_with_its_master_whatever_the_shell_is_set_to(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name, value in {
        'ROS_MASTER_URI': 'http://robot:11311',
        'ROS_NAMESPACE': '/robot',
        'ROS_IP': '10.0.0.1',
        'ROS_HOSTNAME': 'desk',
        'OMP_NUM_THREADS': '3',
    }.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv('OPENBLAS_NUM_THREADS', raising=False)
    environment = environment_of(tmp_path, 4711)
    assert (
        environment['ROS_MASTER_URI'] == 'http://localhost:4711'
        and environment['ROS_HOSTNAME'] == 'localhost'
    )
    assert not {'ROS_NAMESPACE', 'ROS_IP'} & set(environment)
    assert (environment['OMP_NUM_THREADS'], environment['OPENBLAS_NUM_THREADS']) == ('3', '1')
    assert environment[MARK] == str(tmp_path) and environment['PATH'] == os.environ['PATH']


@pytest.mark.parametrize(
    'words, kept',
    [
        ('32768\t60999\n', range(32768, 61000)),
        ('15000 65000', range(15000, 65001)),
        ('1024 65535', range(0)),
        ('nonsense', range(32768, 61000)),
    ],
)
def test_a_free_port_is_none_that_the_system_gives_by_chance(
    tmp_path, monkeypatch, words: str, kept: range
) -> None:
    (tmp_path / 'range').write_text(words)
    monkeypatch.setattr(launching, 'GIVEN_BY_CHANCE', tmp_path / 'range')
    ports = {launching.free_port() for _ in range(50)}
    assert all(port in launching.PORTS and port not in kept for port in ports)


def test_a_free_port_can_be_bound() -> None:
    port = free_port()
    with socket.socket() as server:
        server.bind(('localhost', port))
        assert server.getsockname()[1] == port


@pytest.mark.parametrize('grace_s, code', [(0.0, -signal.SIGKILL), (20.0, 3)])
def test_the_processes_of_a_job_are_found_and_ended_and_no_others(
    grace_s: float, code: int
) -> None:
    program = """
import signal, sys
signal.signal(signal.SIGINT, lambda *_: sys.exit(3))
print('ready', flush=True)
input()
"""
    jobs = [
        subprocess.Popen(
            [sys.executable, '-c', program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env=dict(os.environ, **{MARK: mark}),
        )
        for mark in ('/a', '/a b')
    ]
    try:
        assert all(process.stdout.readline() == b'ready\n' for process in jobs)
        assert marked('/a') == [jobs[0].pid]
        assert end_marked('/a', grace_s) == 1
        assert jobs[0].wait(20) == code and jobs[1].poll() is None
    finally:
        for process in jobs:
            process.kill()
            process.communicate()
    assert end_marked('/a') == 0


def test_without_arguments_it_says_how_it_is_used_and_runs_nothing(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr('sys.argv', ['run_trials'])
    with pytest.raises(SystemExit) as ended:
        main()
    told = capsys.readouterr().err
    assert ended.value.code == 2 and told.startswith('usage: run_trials')
    assert 'name what to run' in told and not list(tmp_path.iterdir())
