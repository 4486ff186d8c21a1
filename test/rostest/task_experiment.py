#!/usr/bin/env python3
"""Experiments with run_trials, which starts masters of its own: stopped, killed and gone on with to
the end, and on a cluster.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import List

from task_cluster import TrialsOnACluster
from waiting import wait_for

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


def bags_of(output: Path) -> Path:
    return output / 'with_oracle' / 'replicate_0'


def some_trials(output: Path, count: int) -> bool:
    """Wait until more than so many trials have been recorded."""
    return bool(wait_for(lambda: len(list(bags_of(output).glob('*.bag'))) > count, 240.0))


class Experiment(TrialsOnACluster):
    @classmethod
    def setUpClass(cls) -> None:
        """Kill an experiment in the middle, and have it go on to its end.

        The run on the cluster is compared with it. There, the second trial of a job follows the
        first in the same process, unless its worker was killed.
        """
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.gone_on = Path(folder.name) / 'gone on'
        killed = start(cls.gone_on, 2)
        in_time = some_trials(cls.gone_on, 0)
        killed.kill()
        text = killed.communicate()[0]
        assert in_time, text
        process = start(cls.gone_on, 2)
        cls.text = process.communicate(timeout=300)[0]
        assert process.returncode == 0, cls.text
        assert processes_of(cls.gone_on) == []

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.output = Path(folder.name) / 'two words'

    def test_it_ends_with_a_table_and_figures(self) -> None:
        self.assertRegex(self.text, 'PICK_AND_PLACE  without oracle +2 ')
        for name in ('time_series.png', 'time_series.svg'):
            self.assertTrue((self.gone_on / name).is_file(), name)

    def test_killed_in_the_middle_it_goes_on(self) -> None:
        self.assertIn('Going on in', self.text)
        trials = load_trials([str(self.gone_on)]).trials
        self.assertEqual(sorted(trial.cause.seed for trial in trials), [1, 1, 2, 2])
        self.assertTrue(all(trial.truth is not None for trial in trials))
        refused = start(self.gone_on, 9)
        self.assertIn('trials: there 2, now 9', refused.communicate(timeout=60)[0])
        self.assertEqual(refused.returncode, 1)

    def test_a_killed_worker_and_a_killed_run_give_the_same_rows(self) -> None:
        self.check_rows_although_a_worker_is_killed(self.gone_on, self.output, start)

    def test_ctrl_c_pressed_twice_stops_everything_even_a_frozen_node_and_keeps_the_bags(
        self,
    ) -> None:
        process = start(self.output, 10000, '--variants', 'with')
        try:
            # the world tells how a trial ended when the next one begins
            self.assertTrue(some_trials(self.output, 1), 'no trials')
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
        self.assertEqual(list(bags_of(self.output).glob('*.active')), [])
        self.assertEqual(load_trials([str(bags_of(self.output))]).skipped, [])


if __name__ == '__main__':
    import rostest

    rostest.rosrun('smach_oracle', 'task_experiment', Experiment)
