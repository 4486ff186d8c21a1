#!/usr/bin/env python3
"""Tests of the script fetch_task.py, as it is, in a ROS node: `rostest PACKAGE fetch_task.test`."""

import os
import sys
import unittest

import rostest

from smach_oracle.testing import crash, expert, fail, no_answer, run_script, supersede

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'fetch_task.py')


class FetchTaskTest(unittest.TestCase):
    """The script makes the node. It runs in this process, with its machine on a test bench."""

    def test_a_failed_grasp_is_tried_again(self):
        run = run_script(SCRIPT, faults=[fail('PICK', visit=1, outcome='aborted')], ros=True)
        run.trial.assert_recovered('PICK').assert_not_asked()
        self.assertEqual(run.exit_code, 0)

    def test_the_expert_does_what_the_arm_cannot(self):
        run = run_script(
            SCRIPT,
            faults=[crash('PLACE')],
            ros=True,
            settings={'max_recoveries': 0},
            expert=expert(supersede('succeeded', about='PLACE')),
        )
        run.trial.assert_asked_about('PLACE', times=1).assert_ended_with('succeeded')
        self.assertEqual(run.exit_code, 0)

    def test_without_an_answer_the_script_ends_as_its_author_wrote_it(self):
        run = run_script(
            SCRIPT,
            faults=[fail('PICK')],
            ros=True,
            expert=expert(no_answer()),
            settings={'max_recoveries': 0},
        )
        run.trial.assert_asked_about('PICK').assert_ended_with('aborted')
        self.assertEqual(run.exit_code, 1)


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'fetch_task', FetchTaskTest, sys.argv)
