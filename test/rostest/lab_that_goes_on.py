#!/usr/bin/env python3
"""Continuous operation with the real nodes: a trial finds what the one before it has left, tidied,
and a run goes on from its rows alone.
"""

import csv
import json
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Dict, List

RUN_TRIALS = 'import sys; from smach_oracle.experiment.command import main; sys.exit(main())'
TRIALS, HOURS, SEED = 3, 0.3, 301
LIMIT_S = 240.0
STAYED_M = 0.01


def run(output: Path) -> str:
    """Run the bare script in one lab; returns what run_trials printed."""
    done = subprocess.run(
        [
            sys.executable,
            '-c',
            RUN_TRIALS,
            '--task',
            'pick_and_place',
            '--benign',
            '--variants',
            'bare',
            '--trials',
            str(TRIALS),
            '--hours',
            str(HOURS),
            '--seed',
            str(SEED),
            '--output',
            str(output),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        universal_newlines=True,
        timeout=LIMIT_S,
        check=False,
    )
    if done.returncode:
        raise AssertionError(done.stdout)
    return done.stdout


def rows(output: Path) -> List[Dict[str, str]]:
    with open(output / 'results.csv', newline='', encoding='utf-8') as file:
        return list(csv.DictReader(file))


class LabThatGoesOn(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def test_trials_follow_each_other_in_one_lab_and_go_on_from_their_rows_alone(self) -> None:
        whole = self.folder / 'whole'
        run(whole)
        told = rows(whole)
        self.assertEqual([row['true_success'] for row in told], ['yes'] * TRIALS, told)
        self.assertEqual(
            [round(float(row['hour']), 3) for row in told],
            [round(number * HOURS / TRIALS, 3) for number in range(TRIALS)],
        )
        left = [json.loads(row['left']) for row in told]
        for state in left:
            self.assertEqual(
                sorted(state['joints']), ['head_pan_joint', 'head_tilt_joint', 'torso_lift_joint']
            )
            self.assertGreater(state['ended'], state['began'])
        for before, after in zip(left, left[1:]):
            self.stays(before['things'], after['things'])
        self.goes_on(whole)

    def stays(self, before: List[dict], after: List[dict]) -> None:
        """What nobody picked stands in the next trial where it stood; nothing else is there."""
        there = {thing['name']: thing['position'] for thing in after}
        self.assertEqual(sorted(there), sorted(thing['name'] for thing in before))
        for thing in before:
            for one, other in zip(thing['position'][:2], there[thing['name']][:2]):
                self.assertLess(abs(one - other), STAYED_M, (before, after))

    def goes_on(self, whole: Path) -> None:
        """The last trial is the same where only the rows of those before it are there."""
        again = self.folder / 'again'
        again.mkdir()
        shutil.copy(str(whole / 'experiment.json'), str(again))
        lines = (whole / 'results.csv').read_text(encoding='utf-8').splitlines(keepends=True)
        (again / 'results.csv').write_text(''.join(lines[:TRIALS]), encoding='utf-8')
        run(again)
        for key in ('seed', 'hour', 'left', 'sim_s', 'why'):
            self.assertEqual(rows(again)[-1][key], rows(whole)[-1][key], key)


if __name__ == '__main__':
    import rostest

    rostest.rosrun('smach_oracle', 'lab_that_goes_on', LabThatGoesOn)
