#!/usr/bin/env python3
"""Each how-to does as its page shows: its files, its commands in order, and what they print."""

import unittest

import rostest
from shown_page import ShownPage


class HowTo(unittest.TestCase):
    def do(self, name):
        page = ShownPage(name)
        self.addCleanup(page.close)
        self.assertTrue(any(text.startswith('$ ') for _, _, _, text in page.blocks))
        page.do()

    def test_a_navigation_task_recovers(self):
        self.do('navigation')

    def test_preconditions_hold_before_a_state_runs_again(self):
        self.do('preconditions')

    def test_an_interface_of_your_own_does_the_work_of_a_state(self):
        self.do('own_interface')

    def test_one_expert_answers_many_robots(self):
        self.do('many_robots')


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'how_to', HowTo)
