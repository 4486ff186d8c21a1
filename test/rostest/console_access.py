#!/usr/bin/env python3
"""The console for those who use no mouse, or do not see it: in a real browser, with axe-core."""

import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from waiting import wait_for

from smach_oracle.msg import ConsoleCommand

if WITH_BROWSER:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys
QUESTION = '.question-row.pending[data-key^="/alpha/"]'
DETECT, PLACE = ('.choice.goto[data-name={}]'.format(state) for state in ('DETECT', 'PLACE'))
FOCUSED = 'return document.activeElement.matches(arguments[0])'
TOLD = 'return document.getElementById("announcer").textContent'
# as soon as `n` would open another question than before: no wall clock has a part in it
N_AT_ONCE = """
const done = arguments[0];
const pending = () => document.querySelector(".question-row.pending");
const press = (key) => document.body.dispatchEvent(
  new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
const look = () => {
  if (!pending()) { requestAnimationFrame(look); return; }
  press("n");
  const opened = Boolean(document.querySelector(".detail"));
  press("Escape");
  done([opened, Boolean(document.querySelector(".detail"))]);
};
look();"""
VIEWBOX = 'return document.querySelector(".machines .graph").getAttribute("viewBox")'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Access(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.audited = []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        cls.begin('console_robot.py', 'PICK', '0.05', '2', '9')
        cls.browser.driver.set_script_timeout(60)

    def focus_is_on(self, selector):
        self.assertTrue(
            wait_for(lambda: self.browser.run(FOCUSED, selector)),
            '{}: the focus is on {}'.format(
                selector, self.browser.run('return document.activeElement.outerHTML.slice(0, 300)')
            ),
        )

    def keys(self, *keys):
        """To whatever has the focus."""
        ActionChains(self.browser.driver, duration=0).send_keys(*keys).perform()

    def told(self, name):
        return [told for told in self.audited if told.command == name]

    def test_1_a_question_that_comes_is_announced_and_n_opens_it_at_once(self):
        browser = self.browser
        self.assertEqual(browser.driver.execute_async_script(N_AT_ONCE), [True, False])
        self.assertEqual(self.told('claim'), [], 'to open sends nothing')
        self.assertTrue(wait_for(lambda: 'New question: PICK' in browser.run(TOLD)))
        self.assertIn('/alpha', browser.run(TOLD))
        self.assertIn('1 question waits.', browser.run(TOLD))
        browser.run('document.querySelector("#tab-questions .badge").textContent = "12"')
        self.assert_accessible('the list of questions')  # one digit alone is not judged
        browser.click('#person')
        browser.find('dialog')
        self.assert_accessible('the name')
        browser.click('#save-name')
        browser.press('n')
        self.focus_is_on('.detail-head h2')
        self.assertTrue(browser.says('Nobody works on it.', '.claim-bar'))

    def test_2_every_view_of_a_question_is_accessible(self):
        browser = self.browser
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(DETECT))))
        self.assert_accessible('a question')
        browser.click('.choice.give_up[data-name=""]')
        self.focus_is_on('[data-action=keep]')
        self.assert_accessible('whether to give up')
        self.keys(Keys.ENTER)
        self.focus_is_on('.choice.give_up[data-name=""]')
        browser.driver.execute_cdp_cmd(
            'Emulation.setDeviceMetricsOverride',
            {'width': 390, 'height': 844, 'deviceScaleFactor': 1, 'mobile': True},
        )
        self.addCleanup(browser.driver.execute_cdp_cmd, 'Emulation.clearDeviceMetricsOverride', {})
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(DETECT))))
        self.assert_accessible('a question on a phone')

    def test_3_after_an_answer_the_focus_goes_to_what_is_next(self):
        browser = self.browser
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(DETECT))))
        browser.run('arguments[0].focus()', browser.find(DETECT))
        browser.press(Keys.ENTER)
        self.assertTrue(wait_for(lambda: len(self.told('claim')) == 1))
        self.assertTrue(browser.says('It asks again', '.follow-up'))
        self.assert_accessible('what follows an answer')
        self.focus_is_on('[data-action=next-question]')
        browser.press(Keys.ENTER)
        self.focus_is_on('.detail-head h2')
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(PLACE))))
        browser.run('arguments[0].focus()', browser.find(PLACE))
        browser.press(' ')
        self.focus_is_on('.follow-up h3, [data-action=next-question], [data-action=back]')
        self.assertTrue(wait_for(lambda: len(self.told('answer')) == 2))
        browser.click('.follow-up [data-action=back]')
        self.focus_is_on('.question-row, .stage h2')
        answered = 'return [...document.querySelectorAll(".question-row:not(.pending)")].length'
        self.assertTrue(wait_for(lambda: not browser.run(answered)), 'it goes from the list')
        self.focus_is_on('.question-row, .stage h2')

    def test_4_the_tree_of_machines_takes_the_arrow_keys(self):
        browser = self.browser
        browser.click('#tab-machines')
        browser.click('.path[title=KITCHEN]')
        browser.find('.machines .state')
        self.assert_accessible('a machine')
        for key, path in (
            (Keys.ARROW_DOWN, 'KITCHEN/FETCH'),
            (Keys.ARROW_DOWN, 'KITCHEN/FETCH'),
            (Keys.HOME, 'KITCHEN'),
            (Keys.ARROW_RIGHT, 'KITCHEN/FETCH'),
            (Keys.ARROW_LEFT, 'KITCHEN'),
            (Keys.END, 'KITCHEN/FETCH'),
            (Keys.ARROW_UP, 'KITCHEN'),
            (Keys.ARROW_DOWN, 'KITCHEN/FETCH'),
        ):
            self.keys(key)
            self.focus_is_on('.path[title="{}"]'.format(path))
        self.keys(Keys.ENTER)
        self.assertTrue(browser.says('KITCHEN/FETCH', '.machines h2'))
        self.focus_is_on('.path[title="KITCHEN/FETCH"][aria-selected=true][tabindex="0"]')
        self.assertEqual(
            browser.run('return document.querySelectorAll(".path[tabindex=\\"0\\"]").length'), 1
        )

    def test_5_a_drawing_moves_by_keys_and_a_list_says_the_same(self):
        browser = self.browser
        browser.find('[id="/alpha/KITCHEN/FETCH/PICK"]')
        before = browser.run(VIEWBOX)
        browser.run('document.querySelector(".machines .graph").focus()')
        self.keys(Keys.ARROW_RIGHT)
        self.assertTrue(wait_for(lambda: browser.run(VIEWBOX) != before))
        browser.click('.path[title=KITCHEN]')
        browser.run('arguments[0].focus()', browser.find('[id="/alpha/KITCHEN/FETCH"]'))
        self.keys(' ')
        self.assertTrue(browser.says('KITCHEN/FETCH', '.machines h2'), 'Space opens it, too')
        browser.click('.machine-card [data-way=list]')
        browser.find('table.states')
        self.assert_accessible('a list of states')
        browser.click('.machine-card [data-way=graph]')

    def test_6_trials_and_sensors_are_accessible(self):
        browser = self.browser
        browser.click('#tab-trials')
        browser.find('.trial')
        self.assertTrue(browser.says('failed', '.event-log'))
        self.assert_accessible('the trials')
        browser.click('#tab-sensors')
        self.assertTrue(browser.says('No sensors', '.sensor-stage'))
        self.assert_accessible('no sensors')
        self.assertEqual(browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_access')
    rostest.rosrun('smach_oracle', 'console_access', Access)
