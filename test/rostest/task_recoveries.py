#!/usr/bin/env python3
"""The unmodified pick and place script on the simulated PR2, under oracle_run: what fails is
recovered, or asked.
"""

import json
import subprocess
import tempfile
import unittest
from pathlib import Path

import rospkg
import rospy
from roslib.packages import find_node

from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.trials import load_trials
from smach_oracle.simulation.scenes.tabletop_scene import draw
from smach_oracle.srv import Judge

TASKS = Path(rospkg.RosPack().get_path('smach_oracle')) / 'src' / 'smach_oracle' / 'tasks'


def seed_with(kind: str) -> int:
    """The first seed of which this is the only cause to fail."""
    return next(
        seed for seed in range(10000) if [cause.kind for cause in draw(seed).causes] == [kind]
    )


class Recoveries(unittest.TestCase):
    """Trials in which an arm is pushed before the camera while the robot looks at the table."""

    def setUp(self) -> None:
        rospy.wait_for_service('world/reset', 60.0)

    def run_task(self, *options: str, **settings: object) -> TrialSummary:
        """Run one trial of the script as a user would, and read its bag."""
        rospy.set_param('/pick_and_place/oracle', settings or {'memory': 10})
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(
                [
                    find_node('smach_oracle', 'oracle_run')[0],
                    '--config',
                    str(TASKS / 'pick_and_place.yaml'),
                    '--record',
                    folder,
                    '--record-topic',
                    '/world/cause',
                    *options,
                    str(TASKS / 'pick_and_place.py'),
                    '--seed',
                    str(seed_with('arm_in_view')),
                ],
                check=True,
                timeout=100,
            )
            (trial,) = load_trials([folder]).trials
        self.assertEqual((trial.cause.kinds, trial.lost_events), (('arm_in_view',), 0))
        return trial

    def truth(self) -> bool:
        judged = rospy.ServiceProxy('world/judge', Judge)()
        self.assertTrue(judged.ok, judged.message)
        print(json.dumps(judged.why))
        return bool(judged.success)

    def test_without_the_oracle_it_ends_the_trial_as_the_author_wrote_it(self) -> None:
        trial = self.run_task('--without-oracle')
        self.assertEqual((trial.outcome, trial.recoveries, trial.questions), ('aborted', 0, 0))
        self.assertEqual(trial.failures_by_state, (('pick_and_place/DETECT_TABLETOP', 1),))
        self.assertFalse(self.truth())

    def test_the_oracle_takes_the_arm_aside_and_looks_again(self) -> None:
        trial = self.run_task()
        self.assertEqual((trial.outcome, trial.questions), ('succeeded', 0))
        self.assertGreater(trial.recoveries, 0)
        self.assertTrue(self.truth())

    def test_an_expert_does_the_work_of_the_failed_state(self) -> None:
        trial = self.run_task(max_recoveries=0)
        self.assertEqual((trial.outcome, trial.recoveries), ('succeeded', 0))
        self.assertGreater(trial.answered, 0)
        self.assertTrue(self.truth())


if __name__ == '__main__':
    import rostest

    rospy.init_node('task_recoveries')
    rostest.rosrun('smach_oracle', 'task_recoveries', Recoveries)
