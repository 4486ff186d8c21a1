#!/usr/bin/env python3
"""The console commands nothing by accident, and says what an answer has led to: in a real browser,
with a real machine under a real oracle.
"""
import os
import sys
import unittest

import rosgraph
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage  # noqa: E402
from waiting import stays, wait_for  # noqa: E402

from smach_oracle.msg import ConsoleCommand, OracleEvent  # noqa: E402

QUESTION = '.question-row[data-key^="/alpha/"]'
OWN_SERVER = '/a_server_of_its_own'
GO_TO_PLACE = '.choice.goto[data-name=PLACE]'
GIVE_UP = '.choice.give_up[data-name=""]'
# what a second tap does as soon as there is something to tap: no wall clock has a part in it
TAP_AT_ONCE = '''
const [row, answer, done] = arguments;
const tap = (element) => {
  const it = { bubbles: true, cancelable: true, detail: 1 };
  element.dispatchEvent(new PointerEvent("pointerdown", it));
  element.dispatchEvent(new MouseEvent("click", it));
};
tap(document.querySelector(row));
const look = () => {
  const button = document.querySelector(answer);
  if (!button || button.disabled) { requestAnimationFrame(look); return; }
  tap(button);
  done();
};
look();'''
MOVE_AND_TAP = '''
const [selector] = arguments;
const box = document.createElement("div");
box.style.height = "60px";
document.querySelector(".answer-form").prepend(box);
document.querySelector(selector).click();
box.remove();'''
REFUSED = 'the page had just changed there'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class OnPurpose(ConsolePage, unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.audited, cls.events = [], []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        rospy.Subscriber('/alpha/oracle/events', OracleEvent, cls.events.append)
        rospy.set_param('/alpha/own_introspection', True)
        cls.begin('console_robot.py', 'PICK', '0.05', '0', '9')

    def answers(self):
        """The kinds of the answers that the console was told to send."""
        return [told.arguments for told in self.audited if told.command == 'answer']

    def press(self, key):
        self.browser.run('document.activeElement.blur()')
        self.browser.find('body').send_keys(key)

    def open_question(self):
        self.browser.click(QUESTION)
        self.assertTrue(wait_for(lambda: self.browser.settled(self.browser.find(GO_TO_PLACE))))

    def test_1_the_second_tap_of_a_double_tap_answers_nothing(self):
        browser = self.browser
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(QUESTION))))
        browser.driver.set_script_timeout(40)
        browser.driver.execute_async_script(TAP_AT_ONCE, QUESTION, GO_TO_PLACE)
        self.assertTrue(browser.says(REFUSED), browser.text())
        self.assertEqual(self.answers(), [])
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(GO_TO_PLACE))))
        browser.run(MOVE_AND_TAP, GO_TO_PLACE)
        self.assertEqual(browser.run('return document.body.dataset.refused'), '2',
                         'it has moved under the pointer')
        self.assertTrue(browser.says('It is yours.'))
        self.assertEqual(self.answers(), [])

    def test_2_giving_up_is_confirmed_and_can_be_undone(self):
        browser = self.browser
        self.press('g')
        self.assertTrue(browser.says('Give up? The work of PICK stays undone'))
        self.press('g')
        self.assertTrue(stays(lambda: not self.answers(), 0.5), 'the key alone sends nothing')
        browser.click('[data-action=confirm-give-up]')
        self.assertTrue(browser.says('Giving up in'))
        self.assertFalse(browser.find('.choice.goto').is_enabled())
        browser.click('[data-action=undo-give-up]')
        self.assertTrue(wait_for(lambda: browser.find(GIVE_UP).is_enabled()))
        browser.click(GIVE_UP)
        browser.click('[data-action=confirm-give-up]')
        self.assertTrue(browser.says('Giving up in'))
        self.press('\ue00c')  # Escape
        self.assertTrue(browser.says('as the failure would have ended', '.give-up-part'),
                        'undone, and the question is still shown')
        browser.click('.other-ends summary')
        browser.click('.choice.give_up[data-name=succeeded]')
        self.assertTrue(browser.says('KITCHEN/FETCH ends with succeeded', '.give-up-asking'))
        browser.click('[data-action=confirm-give-up]')
        self.assertTrue(browser.find('.follow-up'))
        self.assertEqual(len(self.answers()), 1, 'sent once, undone twice')
        self.assertTrue(
            wait_for(lambda: OracleEvent.GIVE_UP in [event.kind for event in self.events]))

    def test_3_single_letter_keys_can_be_turned_off(self):
        browser = self.browser
        browser.click('.follow-up .primary')
        browser.find(QUESTION)
        browser.click('#keys')
        self.press('n')
        self.assertTrue(stays(lambda: not browser.run('return document.querySelector(".detail")'),
                              0.5))
        browser.click('#keys')
        self.press('n')
        browser.find('.detail')
        self.assertEqual(browser.errors(), [])

    def test_9_a_machine_with_a_server_of_its_own_is_listed_once(self):
        def known():
            heard = dict(rosgraph.Master('/test').getSystemState()[1])
            return '/expert_console' in heard.get(OWN_SERVER + '/smach/container_structure', [])
        browser = self.browser
        self.assertTrue(wait_for(known), 'the console follows it')
        browser.click('#tab-machines')
        browser.find('[id="/alpha/KITCHEN/FETCH"]')
        # it tells its structure every 2 s
        self.assertTrue(
            stays(lambda: browser.run(
                'return [...document.querySelectorAll(".picker .robot")]'
                '.map((robot) => robot.textContent)') == ['/alpha'], 5.0))


if __name__ == '__main__':
    rospy.init_node('console_on_purpose')
    rostest.rosrun('smach_oracle', 'console_on_purpose', OnPurpose)
