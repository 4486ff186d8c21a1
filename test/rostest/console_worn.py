#!/usr/bin/env python3
"""A page does not wear out: a question that was opened and left leaves nothing behind in it, and
the list of trials comes only while somebody looks at it.
"""

import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from page_growth import OPEN_AND_LEAVE, samples, slopes_of

WARM_UP, QUESTIONS, EVERY = 10, 200, 40
MOST = {'nodes': 1.0, 'listeners': 0.1}  # growth a question; it has some 400 and 60

# everything that the page's sockets get
LISTEN = """
window.heard = [];
const Socket = window.WebSocket;
window.WebSocket = class extends Socket {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", ({ data }) => window.heard.push(JSON.parse(data)));
  }
};"""
LISTS = 'return window.heard.filter((each) => each.lists || each.sections?.trials)'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Worn(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.begin('console_robot.py', 'PICK', '0.05', '0', '1')

    def test_1_the_list_of_trials_comes_while_somebody_looks_at_it(self):
        driver = self.browser.driver
        driver.execute_cdp_cmd('Page.addScriptToEvaluateOnNewDocument', {'source': LISTEN})
        driver.refresh()
        self.browser.find('.question-row.pending')
        driver.set_script_timeout(60)
        driver.execute_async_script(OPEN_AND_LEAVE, 2)
        self.assertEqual(self.browser.run(LISTS), [], 'the questions are looked at')
        self.browser.click('#tab-trials')
        self.browser.find('.trial-list .trial')
        self.assertTrue(self.browser.run(LISTS)[0]['lists']['trials']['all'])
        self.browser.click('#tab-questions')
        driver.execute_async_script(OPEN_AND_LEAVE, 1)  # by then the server knows
        before = self.browser.run(LISTS)
        driver.execute_async_script(OPEN_AND_LEAVE, 5)
        self.assertEqual(self.browser.run(LISTS), before, 'it was looked at before')
        self.assertEqual(self.browser.errors(), [])

    def test_2_a_question_that_was_left_leaves_nothing_behind(self):
        self.browser.find('.question-row.pending')
        taken = list(samples(self.browser.driver, WARM_UP, QUESTIONS, EVERY))
        slopes = slopes_of(taken)
        for name, most in MOST.items():
            self.assertLess(slopes[name], most, (name, taken))
        self.assertEqual(self.browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_worn')
    rostest.rosrun('smach_oracle', 'console_worn', Worn)
