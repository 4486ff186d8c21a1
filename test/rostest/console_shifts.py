#!/usr/bin/env python3
"""The people at the console: who did what, how long it took, and the note for the next shift. Real
nodes, a real console that is killed, a real browser.
"""

import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from waiting import wait_for

from smach_oracle.msg import ConsoleCommand

QUESTION = '.question-row[data-key^="/alpha/"]'
NOTE = 'Gripper is worn: <b>slow</b> <script>window.hacked = 1</script> ☞ second line'
WRITE = '.note-form textarea'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Shifts(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.file = os.path.join(cls.make_folder(), 'shifts.jsonl')
        cls.audited = []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        cls.begin('console_robot.py', 'PICK', '0.1', '0', '3', name='ann')

    @classmethod
    def start_console(cls, *more):
        return super().start_console('_shift_file:=' + cls.file, *more)

    def test_1_who_did_what_and_how_long_it_took(self):
        browser = self.browser
        browser.click('#tab-people')
        self.assertTrue(browser.says('Nobody has answered a question.', '.panel.people'))
        for number in range(2):  # the console may not have heard of the first one from the start
            browser.click('#tab-questions')
            browser.click(QUESTION)
            self.take()
            browser.click('.choice.goto[data-name=PLACE]')
            self.assertTrue(browser.says('The machine goes to PLACE.', '.follow-up'), number)
            self.assertTrue(browser.says('The trial is over', '.follow-up'), number)
            browser.click('.follow-up [data-action=back]')
        browser.click('#tab-people')
        self.assertTrue(browser.says('Shift from', '.panel.people'))
        row = browser.text('.people tbody tr:nth-child(2)')
        self.assertRegex(row, r'^ann [12] \d+ s \(\d+ s\) \d+ s \(\d+ s\) \d+ s \(\d+ s\)$')
        for told in ('answer goto PLACE', 'claim', '/alpha', 'done'):
            self.assertTrue(browser.says(told, '.acts'), told)
        browser.find('.acts input').send_keys('goto')
        self.assertTrue(wait_for(lambda: len(browser.texts('.acts tbody tr')) == 2))
        self.assertIn('answer goto PLACE', browser.text('.acts tbody'))
        browser.find('.acts input').send_keys('\ue003' * 4)  # Backspace
        self.assertTrue(wait_for(lambda: len(browser.texts('.acts tbody tr')) > 2))

    def test_2_a_note_is_there_after_the_console_was_killed(self):
        browser = self.browser
        browser.find(WRITE).send_keys(NOTE)
        browser.click('.note-form button')
        self.assertTrue(browser.says(NOTE, '.shift-note'))
        self.assertEqual(browser.find(WRITE).get_attribute('value'), '')
        self.assertIsNone(
            browser.run('return window.hacked || document.querySelector(".shift-note b") || null'),
            'a note is text',
        )
        type(self).console.kill()
        self.assertTrue(browser.says('connection lost', '#status'))
        type(self).console = self.start_console()
        self.assertTrue(browser.says('live', '#status', 40.0))
        browser.driver.refresh()
        self.assertTrue(browser.says(NOTE, '.shift-note'), 'it was on the disk')
        self.assertTrue(browser.says('Shift from', '.panel.people'), 'so are the times')
        self.assertEqual(browser.errors(), [])

    def test_3_it_can_be_used_on_a_phone_by_keyboard_and_by_everybody(self):
        browser = self.browser
        for width in (1440, 768, 390):
            browser.screenshot(os.devnull, width, 900)
            self.assertFalse(
                browser.run(
                    'return document.documentElement.scrollWidth > innerWidth'
                    '|| document.querySelector(".panel").scrollWidth > innerWidth'
                ),
                width,
            )
            self.assert_accessible('people at {}'.format(width))
        browser.driver.execute_cdp_cmd('Emulation.clearDeviceMetricsOverride', {})
        done = '.shift-note button'
        self.assertTrue(wait_for(lambda: browser.settled(browser.find(done))))
        browser.run('document.querySelector(arguments[0]).focus()', done)
        browser.press('\ue007')  # Enter
        self.assertTrue(browser.says('No notes.', '.notes'))
        self.assertTrue(wait_for(lambda: self.audited[-1].command == 'drop_note'))
        self.assertEqual((self.audited[-1].expert, self.audited[-1].ok), ('ann', True))


if __name__ == '__main__':
    rospy.init_node('console_shifts')
    rostest.rosrun('smach_oracle', 'console_shifts', Shifts)
