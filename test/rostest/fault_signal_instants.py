#!/usr/bin/env python3
"""Signals at any instant of the first execute: the process ends, and its bags are whole.

In library use rospy itself may hang: where the signal meets the main thread within a line of the
log. The stack of the main thread shows that. The bare script hangs there as well.
"""

import sys
import unittest
from typing import List

import rospy
from signalled_programs import Ending, signal_many

SIGNALS = 20  # to processes of each kind


class SignalInstantsTest(unittest.TestCase):
    def hung(self, kind: str, seed: int) -> List[Ending]:
        """The processes that hung; the bags of all are whole."""
        endings = signal_many(SIGNALS, seed, [kind])
        for ending in endings:
            self.assertEqual(ending.broken_bags, [], ending.output)
        return [ending for ending in endings if ending.code is None]

    def test_of_a_script_under_oracle_run(self) -> None:
        self.assertEqual(self.hung('oracle_run', 1), [])

    def test_of_a_program_that_uses_the_library(self) -> None:
        for ending in self.hung('library', 2):
            main_thread = ending.output.rsplit('Current thread', 1)[-1]
            self.assertIn('rospy/impl/rosout.py', main_thread, ending.output)


if __name__ == '__main__':
    import rostest

    rospy.init_node('fault_signal_instants')
    rostest.rosrun('smach_oracle', 'fault_signal_instants', SignalInstantsTest, sys.argv)
