"""The experiment's own words and refusals; the experiment itself is run by the demo and a rostest."""
import io
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from smach_oracle.simulation.experiment import (ExperimentError, Interrupted, Interrupts, Progress, children_of,
                                                describe, free_port, parse, prepare)


class FakeTerminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def fake_arm(done: int) -> SimpleNamespace:
    return SimpleNamespace(name='with', trials=10, started=0.0, finished_trials=lambda: done)


def test_recorded_trials_are_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / 'old.bag').touch()
    with pytest.raises(ExperimentError, match='not empty'):
        prepare(tmp_path)
    assert prepare(tmp_path / 'new').is_dir()


def test_a_free_port_can_be_bound() -> None:
    with socket.socket() as server:
        server.bind(('localhost', free_port()))


@pytest.mark.parametrize('argv', [['--trials', '0'], ['--jobs', '0'], ['--seed', '-1'], ['--answer-delay', 'nan'],
                                  ['--task', 'dance'], ['--arms', 'three'], ['--policy', 'nonsense']])
def test_wrong_arguments_end_with_usage(argv: list, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as caught:
        parse(argv)
    assert caught.value.code == 2
    assert 'usage' in capsys.readouterr().err


def test_the_default_experiment_is_the_papers() -> None:
    args = parse([])
    assert (args.task, args.trials, args.arms) == ('pick_and_place', 150, 'both')


def test_progress_names_the_arm_and_the_time_left_only_while_there_is_one() -> None:
    assert describe(fake_arm(0)) == 'with oracle 0/10'
    assert describe(fake_arm(4)).startswith('with oracle 4/10, ')
    assert describe(fake_arm(10)) == 'with oracle 10/10'


def test_progress_rewrites_its_line_on_a_terminal_and_spares_a_log() -> None:
    terminal, log = FakeTerminal(), io.StringIO()
    for stream in (terminal, log):
        progress = Progress(stream)
        for done in (0, 0, 10):
            progress.show([fake_arm(done)])
        progress.end()
    assert terminal.getvalue().count('\r') == 2
    assert log.getvalue() == 'with oracle 0/10\n'


@pytest.mark.parametrize('signum', Interrupts.SIGNALS)
def test_signals_are_kept_for_a_moment_at_which_they_can_do_no_harm(signum: int) -> None:
    before = signal.getsignal(signum)
    with Interrupts() as interrupts:
        interrupts.check()
        for again in (signum, signal.SIGINT):
            os.kill(os.getpid(), again)
        with pytest.raises(Interrupted) as caught:
            interrupts.check()
    assert caught.value.signum == signum
    assert signal.getsignal(signum) == before


def test_the_processes_that_a_process_started_are_found() -> None:
    child = subprocess.Popen([sys.executable, '-c', 'input()'], stdin=subprocess.PIPE)
    try:
        assert child.pid in children_of(os.getpid())
    finally:
        child.communicate(b'')
    assert child.pid not in children_of(os.getpid())
