#!/usr/bin/env python3
"""Signals at any instant of the first execute: the process ends, and its bags are whole."""
import sys
import unittest

import rospy
from signalled_programs import signal_many

SIGNALS = 20  # to processes of each kind


class SignalInstantsTest(unittest.TestCase):
    def check(self, kind: str, seed: int) -> None:
        for ending in signal_many(SIGNALS, seed, [kind]):
            self.assertIsNotNone(ending.code, ending)
            self.assertEqual(ending.broken_bags, [], ending)

    def test_of_a_script_under_oracle_run(self) -> None:
        self.check('oracle_run', 1)

    def test_of_a_program_that_uses_the_library(self) -> None:
        self.check('library', 2)


if __name__ == '__main__':
    import rostest
    rospy.init_node('fault_signal_instants')
    rostest.rosrun('smach_oracle', 'fault_signal_instants', SignalInstantsTest, sys.argv)
