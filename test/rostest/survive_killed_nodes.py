#!/usr/bin/env python3
"""A robot goes on while its expert server, itself and everything at once are killed; on a master of
its own. Many more in benchmarks/killed_nodes.py.
"""

import os
import sys
import tempfile
import unittest

import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from killed_fleet import KilledFleet

KILLED = ['server', 'robot', 'all']


class KilledNodesTest(unittest.TestCase):
    def test_each_round_is_told_and_each_question_is_closed_once(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        fleet = KilledFleet(folder.name, robots=1)
        self.addCleanup(fleet.stop)
        fleet.start()
        kinds = iter(KILLED)
        fleet.run_under_kills(lambda: next(kinds), len(KILLED), 1, 0.5)
        found = fleet.judge()
        self.assertEqual(found.wrong, [])
        self.assertGreaterEqual(found.rounds, len(KILLED))
        self.assertEqual(found.resumed, 2)
        self.assertEqual(found.answered + found.expired, found.questions)


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'survive_killed_nodes', KilledNodesTest)
