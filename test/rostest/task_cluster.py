"""Trials of the simulated tabletop on a real Dask cluster on loopback, beside the local pool.

Each launch has a master and a world of its own. One of two workers is killed in the middle.
task_experiment.py runs this, whose experiment on the local pool has been killed and gone on with.
"""

import io
import signal
import subprocess
import sys
import unittest
from contextlib import redirect_stdout
from pathlib import Path
from typing import Callable, List

sys.path.append(str(Path(__file__).resolve().parents[1] / 'unit' / 'support'))

from dask_cluster import DaskCluster
from waiting import wait_for

from smach_oracle.analysis import trial_steps
from smach_oracle.analysis.trial_rows import TrialRow, read_rows

# by the clock of the machine, or of the robot's program: no two runs have the same
BY_THE_CLOCK = ('wall_s', 'expert_s', 'sim_s', 'asked_s', 'tries', 'account', 'cause_log', 'harmed')


def rows_in(output: Path) -> List[TrialRow]:
    """The rows, without times."""
    rows = [
        row._replace(**dict.fromkeys(BY_THE_CLOCK)) for row in read_rows(output / 'results.csv')
    ]
    return sorted(rows, key=lambda row: (row.variant, row.seed))


Start = Callable[..., 'subprocess.Popen[str]']


class TrialsOnACluster(unittest.TestCase):
    """Its heirs run experiments."""

    def check_rows_although_a_worker_is_killed(self, here: Path, there: Path, start: Start) -> None:
        """Run two trials of each variant on a cluster.

        :param here: where the local pool has done that.
        """
        with DaskCluster(Path(str(there) + ' of dask'), 2) as dask:
            process = start(there, 2, '--jobs', '2', '--scheduler', dask.address)
            self.addCleanup(process.kill)
            # its trial runs: a bag is open
            self.assertTrue(wait_for(lambda: any(there.rglob('*.bag.active')), 240.0), 'no trial')
            dask.workers[0].send_signal(signal.SIGKILL)
            text = process.communicate(timeout=300)[0]
        self.assertEqual(process.returncode, 0, text)
        self.assertIn('started again', text)
        self.assertEqual(len(rows_in(here)), 4)
        self.assertEqual(rows_in(there), rows_in(here), text)
        with redirect_stdout(io.StringIO()) as told:
            same = trial_steps.main([str(here), str(there)])
        self.assertEqual(same, trial_steps.SAME, told.getvalue())
        self.assertIn('4 trials in both', told.getvalue())
        left = [path for kind in ('.claimed*', '*.active') for path in there.rglob(kind)]
        self.assertEqual(left, [])
