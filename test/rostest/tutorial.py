#!/usr/bin/env python3
"""The tutorial does as its page shows: its files, its commands in order, and what they print."""

import os
import unittest

import rostest
from shown_page import ShownPage


class Tutorial(unittest.TestCase):
    def test_it_does_as_the_page_shows(self):
        page = ShownPage('tutorial')
        self.addCleanup(page.close)
        self.assertGreater(len(page.blocks), 12)
        page.do()
        self.assertEqual(len(os.listdir(os.path.join(page.folder, 'bags'))), 3)


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'tutorial', Tutorial)
