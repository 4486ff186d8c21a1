#!/usr/bin/env python3
"""A whole experiment with run_trials, which starts masters of its own: to its end, and stopped in the middle."""
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import List

from waiting import wait_for

from smach_oracle.analysis.trials import load_trials

RUN_TRIALS = 'import sys; from smach_oracle.simulation.experiment.command import main; sys.exit(main())'


def start(output: Path, trials: int) -> 'subprocess.Popen[str]':
    """Run run_trials as from a shell of its own, with the Python that has rosbags."""
    return subprocess.Popen([sys.executable, '-c', RUN_TRIALS, '--trials', str(trials), '--output', str(output)],
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)


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


class Experiment(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.output = Path(folder.name) / 'two words'

    def test_it_records_both_arms_counts_them_and_draws_also_in_a_folder_with_a_space(self) -> None:
        process = start(self.output, 2)
        text = process.communicate(timeout=100)[0]
        self.assertEqual(process.returncode, 0, text)
        self.assertEqual(sorted(trial.recovers for trial in load_trials([str(self.output)]).trials),
                         [False, False, True, True])
        self.assertIn('PICK_AND_PLACE  without oracle     2', text)
        self.assertTrue((self.output / 'time_series.png').is_file() and (self.output / 'time_series.svg').is_file())
        self.assertEqual(processes_of(self.output), [])

    def test_ctrl_c_pressed_twice_stops_everything_even_a_frozen_node_and_keeps_the_bags(self) -> None:
        process = start(self.output, 10000)
        bags = self.output / 'with_oracle'
        try:
            self.assertTrue(wait_for(lambda: len(list(bags.glob('*.bag'))) > 2, 60.0), 'no trials')
            frozen = next(pid for pid in processes_of(self.output)
                          if b'stub_world' in Path('/proc/{}/cmdline'.format(pid)).read_bytes())
            os.kill(frozen, signal.SIGSTOP)
            for _ in range(2):
                process.send_signal(signal.SIGINT)
                time.sleep(1.0)
            text = process.communicate(timeout=60)[0]
        finally:
            process.kill()
        self.assertEqual(process.returncode, 130, text)
        self.assertIn('what was recorded stays', text)
        self.assertEqual(processes_of(self.output), [])
        self.assertEqual(list(bags.glob('*.active')), [])
        self.assertEqual(load_trials([str(bags)]).skipped, [])


if __name__ == '__main__':
    import rostest
    rostest.rosrun('smach_oracle', 'task_experiment', Experiment)
