"""Trials on a real Dask cluster on loopback. Its launches are fakes that record bags."""

import os
import shlex
import sys
import time
from pathlib import Path

import pytest
from dask_cluster import DaskCluster
from fake_roslaunch import FLAG

from smach_oracle import cluster as cluster_module
from smach_oracle.analysis.trial_rows import read_rows
from smach_oracle.cluster import WorkerCluster
from smach_oracle.experiment import cluster_launch
from smach_oracle.experiment.command import main, parse
from smach_oracle.experiment.pool import run
from smach_oracle.experiment.results import RESULTS_FILE

HUNG_S = 600.0
FAKE = Path(__file__).parent.parent / 'support' / 'fake_roslaunch.py'


@pytest.fixture
def with_fake(monkeypatch, tmp_path):
    """A roslaunch on the path of this process and of all that it starts."""
    program = tmp_path / 'bin' / 'roslaunch'
    program.parent.mkdir()
    command = ' '.join(map(shlex.quote, [sys.executable, str(FAKE)]))
    program.write_text('#!/bin/sh\nexec {} "$@"\n'.format(command))
    program.chmod(0o755)
    monkeypatch.setenv('PATH', '{}:{}'.format(program.parent, os.environ['PATH']))
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(filter(None, sys.path)))


def rows_in(output):
    return sorted(read_rows(output / RESULTS_FILE), key=lambda row: (row.variant, row.seed))


def test_rows_are_those_of_this_machine_although_a_worker_dies(
    with_fake, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(cluster_module, 'ANSWER_S', 120.0)
    plan = parse(['--task', 'inspection', '--trials', '3', '--seed', '100']).plan
    here, there = tmp_path / 'here', tmp_path / 'there'
    for output in (here, there):
        output.mkdir()
    run(plan, here, 2, HUNG_S)
    (there / FLAG).touch()
    capsys.readouterr()
    with DaskCluster(tmp_path / 'dask', 2) as dask, WorkerCluster(dask.address) as cluster:
        jobs = run(plan, there, 2, HUNG_S, cluster)
        assert [worker.poll() for worker in dask.workers].count(None) == 1
    told = capsys.readouterr().out
    assert 'seed 101: it ended before its trials were over' in told and 'started again' in told
    assert not (there / FLAG).exists() and not any(job.lost for job in jobs)
    assert len(rows_in(here)) == 6 and rows_in(there) == rows_in(here)
    assert not list(there.rglob('.claimed*')) and not list(there.rglob('*.active'))


@pytest.mark.parametrize(
    'text, wanted',
    [
        ('mine run 0\n', True),
        ('mine stop 0\n', False),
        ('other run 0\n', False),
        ('', False),
        (None, False),
    ],
)
def test_a_launch_goes_on_while_its_own_run_is_wanted(tmp_path, text, wanted):
    if text is not None:
        (tmp_path / cluster_launch.WANTED_FILE).write_text(text)
    assert bool(cluster_launch._Wanted(tmp_path, 'mine')) is wanted


def test_nobody_wants_a_launch_any_more_whose_file_stays_as_it_is(tmp_path, monkeypatch):
    now, file = [1000.0], tmp_path / cluster_launch.WANTED_FILE
    monkeypatch.setattr(time, 'monotonic', lambda: now[0])
    file.write_text('mine run 0\n')
    wanted = cluster_launch._Wanted(tmp_path, 'mine')
    for number in range(1, 4):
        assert wanted
        now[0] += cluster_launch.LEASE_S - 1
        file.write_text('mine run {}\n'.format(number))
    assert wanted
    file.unlink()  # the folder may be away for a moment
    now[0] += cluster_launch.LEASE_S - 1
    assert wanted
    now[0] += 2
    assert not wanted


def test_a_launch_is_claimed_once(tmp_path):
    (tmp_path / cluster_launch.CLAIM_FILE.format('token')).touch()
    told = cluster_launch.run_in_worker(str(tmp_path), 'token', 'x.launch', {})
    assert told == 'the worker that had begun it is gone'


@pytest.mark.parametrize('argv', [['--without-tls'], ['--jobs', '0', '--scheduler', '[::1]:1']])
def test_options_that_make_no_sense_are_refused(argv):
    with pytest.raises(SystemExit):
        main(['--task', 'inspection', *argv])


@pytest.mark.parametrize(
    'address, why', [('8786', 'not an address'), ('10.0.0.5:8786', 'without TLS')]
)
def test_an_address_that_is_refused_leaves_nothing_behind(address, why, tmp_path, capsys):
    output = tmp_path / 'output'
    argv = ['--task', 'inspection', '--scheduler', address, '--output', str(output)]
    assert main(argv) == 1 and why in capsys.readouterr().err
    assert not output.exists()


def test_without_dask_it_is_said_what_installs_it(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    argv = ['--scheduler', '127.0.0.1:1', '--output', str(tmp_path / 'output')]
    assert main(argv) == 2
    assert 'sudo apt install python3-distributed' in capsys.readouterr().err
