#!/usr/bin/env python3
"""Trials of the simulated tabletop on a real Dask cluster on loopback, beside the local pool.

Each launch has a master and a world of its own. One of two workers is killed in the middle.
"""

import io
import os
import signal
import subprocess
import sys
import tempfile
import unittest
from contextlib import redirect_stdout
from pathlib import Path
from typing import List

sys.path.append(str(Path(__file__).resolve().parents[1] / 'unit' / 'support'))

from dask_cluster import DaskCluster
from waiting import wait_for

from smach_oracle.analysis import trial_steps
from smach_oracle.analysis.trial_rows import TrialRow, read_rows

RUN_TRIALS = 'import sys; from smach_oracle.experiment.command import main; sys.exit(main())'
# by the clock of the machine, or of the robot's program: no two runs have the same
BY_THE_CLOCK = ('wall_s', 'expert_s', 'sim_s', 'asked_s', 'tries', 'account', 'cause_log', 'harmed')


def start(output: Path, *options: str) -> 'subprocess.Popen[str]':
    """Run two trials of each of two variants, with the Python that has rosbags."""
    arguments = ['--trials', '2', '--jobs', '2', '--output', str(output), *options]
    return subprocess.Popen(
        [sys.executable, '-c', RUN_TRIALS, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        universal_newlines=True,
    )


def rows_in(output: Path) -> List[TrialRow]:
    """The rows, without times."""
    rows = [
        row._replace(**dict.fromkeys(BY_THE_CLOCK)) for row in read_rows(output / 'results.csv')
    ]
    return sorted(rows, key=lambda row: (row.variant, row.seed))


class TrialsOnACluster(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def finish(self, process: 'subprocess.Popen[str]') -> str:
        text = process.communicate(timeout=300)[0]
        self.assertEqual(process.returncode, 0, text)
        return text

    def test_rows_are_those_of_the_local_pool_although_a_worker_is_killed(self) -> None:
        here, there = self.folder / 'here', self.folder / 'there'
        self.finish(start(here))
        with DaskCluster(self.folder / 'dask', 2) as dask:
            process = start(there, '--scheduler', dask.address)
            self.addCleanup(process.kill)
            # its trial runs: a bag is open
            self.assertTrue(wait_for(lambda: any(there.rglob('*.bag.active')), 240.0), 'no trial')
            dask.workers[0].send_signal(signal.SIGKILL)
            text = self.finish(process)
        self.assertIn('started again', text)
        self.assertEqual(len(rows_in(here)), 4)
        self.assertEqual(rows_in(there), rows_in(here), text)
        with redirect_stdout(io.StringIO()) as told:
            same = trial_steps.main([str(here), str(there)])
        self.assertEqual(same, trial_steps.SAME, told.getvalue())
        self.assertIn('4 trials in both', told.getvalue())
        left = [path for kind in ('.claimed*', '*.active') for path in there.rglob(kind)]
        self.assertEqual(left, [])


if __name__ == '__main__':
    import rostest

    os.environ.setdefault('PYTHONUNBUFFERED', '1')
    rostest.rosrun('smach_oracle', 'task_cluster', TrialsOnACluster)
