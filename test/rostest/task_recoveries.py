#!/usr/bin/env python3
"""The unmodified pick and place script under oracle_run: each kind of fault is recovered as its cure demands."""
import subprocess
import tempfile
import unittest
from pathlib import Path

import rospkg
import yaml
from roslib.packages import find_node

from smach_oracle.analysis.trials import TrialSummary, load_trials
from smach_oracle.simulation.fault_model import (EXPERT, PRECONDITIONS, STEP_BACK, TRANSIENT, FaultSettings,
                                                 draw_faults)

TASKS = Path(rospkg.RosPack().get_path('smach_oracle')) / 'src' / 'smach_oracle' / 'tasks'


def seed_with(cure: str) -> int:
    """The first seed whose only fault has this cure."""
    settings = FaultSettings()
    return next(seed for seed in range(10000) if [fault.cure for fault in draw_faults(seed, settings)] == [cure])


def run_task(seed: int, *options: str) -> TrialSummary:
    """Run one trial of the script as a user would, and read its bag."""
    settings = yaml.safe_load((TASKS / 'pick_and_place.yaml').read_text())
    settings['interfaces'] = {'assist': {'action': 'world/assist'}}  # the one that the stub has
    with tempfile.TemporaryDirectory() as folder, tempfile.NamedTemporaryFile('w', suffix='.yaml') as config:
        yaml.safe_dump(settings, config)
        config.flush()
        subprocess.run([find_node('smach_oracle', 'oracle_run')[0], '--config', config.name,
                        '--record', folder, *options, str(TASKS / 'pick_and_place.py'), '--seed', str(seed)],
                       check=True, timeout=60)
        trial, = load_trials([folder]).trials
        return trial


class Recoveries(unittest.TestCase):
    """One trial for each cure, with the default fault model and the task's own settings."""

    def check_recovered(self, cure: str) -> TrialSummary:
        trial = run_task(seed_with(cure))
        self.assertEqual((trial.outcome, trial.lost_events), ('succeeded', 0))
        self.assertGreater(trial.recoveries, 0)
        return trial

    def test_a_transient_fault_is_outlived_without_a_question(self) -> None:
        self.assertEqual(self.check_recovered(TRANSIENT).questions, 0)

    def test_preconditions_cure_what_they_can_without_a_question(self) -> None:
        self.assertEqual(self.check_recovered(PRECONDITIONS).questions, 0)

    def test_stepping_back_cures_what_it_can_without_a_question(self) -> None:
        self.assertEqual(self.check_recovered(STEP_BACK).questions, 0)

    def test_an_experts_hand_ends_what_nothing_else_does(self) -> None:
        trial = self.check_recovered(EXPERT)
        self.assertEqual((trial.questions, trial.answered), (1, 1))

    def test_without_the_oracle_the_same_fault_ends_the_trial_as_the_author_wrote_it(self) -> None:
        trial = run_task(seed_with(TRANSIENT), '--without-oracle')
        self.assertEqual((trial.outcome, trial.recoveries, trial.questions), ('aborted', 0, 0))
        self.assertFalse(trial.recovers)


if __name__ == '__main__':
    import rostest
    rostest.rosrun('smach_oracle', 'task_recoveries', Recoveries)
