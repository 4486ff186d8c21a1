"""Where there is a core for each job, the processes of a job stay on one."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from smach_oracle.experiment import launching, pool

PRINT_CORES = 'import os, sys; sys.stdout.write(repr(sorted(os.sched_getaffinity(0))))'


@pytest.mark.parametrize(
    'cores, taken, at_a_time, core',
    [
        ({0, 1}, [], 2, 0),
        ({0, 1}, [0], 2, 1),
        ({0, 1}, [1], 2, 0),
        ({4, 6}, [4], 2, 6),
        ({0, 1}, [], 1, None),
        ({0, 1}, [], 3, None),
        ({0, 1, 2, 3}, [0], 2, None),
    ],
)
def test_a_job_gets_a_free_core_where_there_is_one_for_each(
    monkeypatch, cores, taken, at_a_time, core
):
    monkeypatch.setattr(os, 'sched_getaffinity', lambda pid: cores)
    active = [SimpleNamespace(core=each) for each in taken]
    assert pool._free_core(active, at_a_time) == core


def test_all_that_a_job_starts_stays_on_its_core(tmp_path, monkeypatch):
    command = tmp_path / 'roslaunch'
    command.write_text('#!/bin/sh\nexec {} -c "{}"\n'.format(sys.executable, PRINT_CORES))
    command.chmod(0o755)
    monkeypatch.setenv('PATH', '{}:{}'.format(tmp_path, os.environ['PATH']))
    every = sorted(os.sched_getaffinity(0))
    for core, expected in ((every[-1], [every[-1]]), (None, every)):
        folder = tmp_path / 'job_{}'.format(core)
        folder.mkdir()
        launch = launching.Launch(folder, 'any.launch', {}, core)
        try:
            launch._process.wait(60)
        except subprocess.TimeoutExpired:
            pytest.fail('the stand-in for roslaunch does not end')
        launch.stop()
        assert (folder / launching.LOG_FILE).read_text() == repr(expected)
