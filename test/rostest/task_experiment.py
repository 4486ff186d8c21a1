#!/usr/bin/env python3
"""Whole experiments with run_trials, which starts masters of its own: to the end, stopped, killed,
gone on with, and on a cluster.
"""

import io
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stdout
from pathlib import Path
from typing import List

from task_cluster import TrialsOnACluster
from waiting import wait_for

from smach_oracle.analysis import trial_steps
from smach_oracle.analysis.trials import load_trials

RUN_TRIALS = 'import sys; from smach_oracle.experiment.command import main; sys.exit(main())'


def start(output: Path, trials: int, *options: str) -> 'subprocess.Popen[str]':
    """Run run_trials as from a shell of its own, with the Python that has rosbags."""
    return subprocess.Popen(
        [
            sys.executable,
            '-c',
            RUN_TRIALS,
            '--trials',
            str(trials),
            '--output',
            str(output),
            *options,
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        universal_newlines=True,
    )


def processes_of(output: Path) -> List[int]:
    """All processes that have the folder in their command line."""
    found = []
    for command_line in Path('/proc').glob('[0-9]*/cmdline'):
        try:
            if os.fsencode(str(output)) in command_line.read_bytes():
                found.append(int(command_line.parent.name))
        except OSError:
            continue  # it has ended meanwhile
    return found


class Experiment(TrialsOnACluster):
    @classmethod
    def setUpClass(cls) -> None:
        """Run an experiment to its end, with which others are compared."""
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.whole = Path(folder.name) / 'another run'
        process = start(cls.whole, 2)
        cls.text = process.communicate(timeout=300)[0]
        assert process.returncode == 0, cls.text
        assert processes_of(cls.whole) == []

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.output = Path(folder.name) / 'two words'
        self.bags = self.output / 'with_oracle' / 'replicate_0'

    def finish(self, process: 'subprocess.Popen[str]') -> str:
        text = process.communicate(timeout=300)[0]
        self.assertEqual(process.returncode, 0, text)
        self.assertEqual(processes_of(self.output), [])
        return text

    def some_trials(self, count: int) -> None:
        self.assertTrue(
            wait_for(lambda: len(list(self.bags.glob('*.bag'))) > count, 240.0), 'no trials'
        )

    def test_it_ends_with_a_table_and_figures(self) -> None:
        self.assertRegex(self.text, 'PICK_AND_PLACE  without oracle +2 ')
        for name in ('time_series.png', 'time_series.svg'):
            self.assertTrue((self.whole / name).is_file(), name)

    def test_rows_of_a_cluster_are_the_same_although_a_worker_is_killed(self) -> None:
        self.check_rows_although_a_worker_is_killed(self.whole, self.output, start)

    def test_killed_in_the_middle_it_goes_on_as_if_nothing_had_happened(self) -> None:
        killed = start(self.output, 2)
        self.some_trials(0)
        killed.kill()
        killed.communicate()
        self.assertIn('Going on in', self.finish(start(self.output, 2)))
        trials = load_trials([str(self.output)]).trials
        self.assertEqual(sorted(trial.cause.seed for trial in trials), [1, 1, 2, 2])
        self.assertTrue(all(trial.truth is not None for trial in trials))
        # the same seeds: the same states, outcomes and decisions
        with redirect_stdout(io.StringIO()) as told:
            self.assertEqual(
                trial_steps.main([str(self.output), str(self.whole)]),
                trial_steps.SAME,
                told.getvalue(),
            )
        self.assertIn('4 trials in both', told.getvalue())
        refused = start(self.output, 9)
        self.assertIn('trials: there 2, now 9', refused.communicate(timeout=60)[0])
        self.assertEqual(refused.returncode, 1)

    def test_ctrl_c_pressed_twice_stops_everything_even_a_frozen_node_and_keeps_the_bags(
        self,
    ) -> None:
        process = start(self.output, 10000, '--variants', 'with')
        try:
            self.some_trials(1)  # the world tells how a trial ended when the next one begins
            frozen = next(
                pid
                for pid in processes_of(self.output)
                if b'pr2_world' in Path('/proc/{}/cmdline'.format(pid)).read_bytes()
            )
            os.kill(frozen, signal.SIGSTOP)
            for _ in range(2):
                process.send_signal(signal.SIGINT)
                time.sleep(1.0)  # as somebody who has lost patience
            text = process.communicate(timeout=90)[0]
        finally:
            process.kill()
        self.assertEqual(process.returncode, 130, text)
        self.assertIn('what was recorded stays', text)
        self.assertEqual(processes_of(self.output), [])
        self.assertEqual(list(self.bags.glob('*.active')), [])
        self.assertEqual(load_trials([str(self.bags)]).skipped, [])


if __name__ == '__main__':
    import rostest

    rostest.rosrun('smach_oracle', 'task_experiment', Experiment)
