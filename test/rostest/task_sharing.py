#!/usr/bin/env python3
"""Trials that are run once and count for several variants, with real jobs: what each variant
records is what it records where it runs them itself, also if it is killed in the middle.
"""

import io
import json
import subprocess
import sys
import tempfile
import unittest
from contextlib import redirect_stdout
from pathlib import Path

from waiting import wait_for

from smach_oracle.analysis import trial_steps
from smach_oracle.analysis.trial_rows import TrialRow, read_rows

# seeds on which the package was tried out. A state fails in the first trial alone
FIRST_SEED, TRIALS = 704, 3
VARIANT = 'one_line:escalating'
RUN = """
import sys
from pathlib import Path
from smach_oracle.experiment import job
from smach_oracle.experiment.plan import ExperimentPlan, enter_folder, named_variants
from smach_oracle.experiment.pool import run
folder, shares = Path(sys.argv[1]), sys.argv[2] == 'shared'
variants = named_variants(['bare', '{}'], {{}})
plan = ExperimentPlan('pick_and_place', {}, {}, 1, variants, 15.0, shares=shares)
enter_folder(folder, plan)
run(plan, folder, 2, 900.0)
""".format(VARIANT, TRIALS, FIRST_SEED)
TIMES = {'wall_s', 'version', 'shared', 'account', 'tries'}  # columns


def start(output: Path, how: str) -> 'subprocess.Popen[str]':
    output.mkdir(parents=True, exist_ok=True)
    return subprocess.Popen(
        [sys.executable, '-c', RUN, str(output), how],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        universal_newlines=True,
    )


def told(row: TrialRow) -> dict:
    """A row without what differs between two runs of the same trial: times of the machine."""
    told = {key: value for key, value in row._asdict().items() if key not in TIMES}
    return {**told, 'learned': json.loads(row.learned)}


class SharedTrials(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.apart, self.shared = Path(folder.name) / 'apart', Path(folder.name) / 'shared'

    def finish(self, process: 'subprocess.Popen[str]') -> None:
        text = process.communicate(timeout=300)[0]
        self.assertEqual(process.returncode, 0, text)

    def test_a_variant_that_was_killed_in_the_middle_has_what_it_has_without_sharing(self) -> None:
        apart = start(self.apart, 'apart')
        killed = start(self.shared, 'shared')
        bags = self.shared / VARIANT / 'replicate_0'
        self.assertTrue(wait_for(lambda: any(bags.glob('*.bag')), 240.0), 'no trials')
        killed.kill()
        killed.communicate()
        self.finish(start(self.shared, 'shared'))
        self.finish(apart)
        rows = [
            {(row.variant, row.seed): row for row in read_rows(folder / 'results.csv')}
            for folder in (self.apart, self.shared)
        ]
        seeds = range(FIRST_SEED, FIRST_SEED + TRIALS)
        self.assertEqual(
            [rows[1][VARIANT, seed].shared for seed in seeds], [False, True, True], rows[1]
        )
        self.assertEqual(*({key: told(row) for key, row in each.items()} for each in rows))
        with redirect_stdout(io.StringIO()) as text:
            code = trial_steps.main([str(self.apart), str(self.shared)])
        self.assertEqual(code, trial_steps.SAME, text.getvalue())
        self.assertIn('{} trials in both'.format(2 * TRIALS), text.getvalue())
        self.assertFalse((self.shared / 'sharing_ended.json').exists())


if __name__ == '__main__':
    import rostest

    rostest.rosrun('smach_oracle', 'task_sharing', SharedTrials)
