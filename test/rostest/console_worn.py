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

BEGINNING, QUESTIONS = 10, 200
MOST_NODES, MOST_LISTENERS = 40, 2  # a question; it has some 400 and 60
# by keys: open the oldest question, until it is taken and drawn; leave it, until it waits again
OPEN_AND_LEAVE = '''
const [times, done] = arguments;
if (!window.realNow) { // what the page holds back for 0.7 s is held back for 0.02 s
  window.realNow = performance.now.bind(performance);
  performance.now = () => window.realNow() * 35;
}
const press = (key) => window.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
const until = (selector) => new Promise((resolve) => {
  const look = () => (document.querySelector(selector) ? resolve() : setTimeout(look, 20));
  look();
});
(async () => {
  for (let time = 0; time < times; time += 1) {
    await until(".question-row.pending");
    do { // a key is refused for a moment after what it would do has changed
      await new Promise((resolve) => { setTimeout(resolve, 100); });
      press("n");
    } while (!document.querySelector(".detail"));
    await until(".detail .claim-bar.good");
    await until(".detail .state");
    press("Escape");
  }
  await until(".question-row.pending");
  done();
})();'''

# everything that the page's sockets get
LISTEN = '''
window.heard = [];
const Socket = window.WebSocket;
window.WebSocket = class extends Socket {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", ({ data }) => window.heard.push(JSON.parse(data)));
  }
};'''
LISTS = 'return window.heard.filter((each) => each.lists || each.sections?.trials)'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Worn(ConsolePage, unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.begin('console_robot.py', 'PICK', '0.05', '0', '1')

    def counted(self, questions):
        """Open so many; returns how many nodes and listeners the browser holds afterwards."""
        driver = self.browser.driver
        driver.execute_async_script(OPEN_AND_LEAVE, questions)
        for _ in range(2):
            driver.execute_cdp_cmd('HeapProfiler.collectGarbage', {})
        metrics = {
            metric['name']: metric['value']
            for metric in driver.execute_cdp_cmd('Performance.getMetrics', {})['metrics']
        }
        return metrics['Nodes'], metrics['JSEventListeners']

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
        driver = self.browser.driver
        driver.set_script_timeout(240)
        driver.execute_cdp_cmd('Performance.enable', {})
        self.browser.find('.question-row.pending')
        before, after = self.counted(BEGINNING), self.counted(QUESTIONS)
        nodes, listeners = ((late - early) / QUESTIONS for early, late in zip(before, after))
        self.assertLess(nodes, MOST_NODES, (before, after))
        self.assertLess(listeners, MOST_LISTENERS, (before, after))
        self.assertEqual(self.browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_worn')
    rostest.rosrun('smach_oracle', 'console_worn', Worn)
