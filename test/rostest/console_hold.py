#!/usr/bin/env python3
"""A machine under oracle_run, held from the page in a real browser: stopped by who may only look,
paused, let go, with breakpoints and confirmations.
"""

import os
import sys
import unittest

import rospy
import rostest
from roslib.packages import find_node

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import HERE, WITH_BROWSER, ConsolePage, Node
from waiting import wait_for

from smach_oracle.msg import ConsoleCommand, ControlStatus

STOP, PAUSE = '[data-action=stop-machine]', '[data-action=pause-machine]'
RESUME, STEP = '[data-action=resume-machine]', '[data-action=step-machine]'
CONFIRM = '[data-action=confirm-state]'
STANDING = '.machine-hand .standing'
MACHINE = 'alpha'
SETTINGS = '{states: {INNER/FOURTH: {autonomy: confirm}}}'


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Hold(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = cls.make_folder()
        cls.tokens = os.path.join(cls.folder, 'tokens')
        cls.config = os.path.join(cls.folder, 'oracle.yaml')
        with open(cls.config, 'w') as file:
            file.write(SETTINGS)
        cls.audited, cls.told = [], []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        rospy.Subscriber('/alpha/oracle/control', ControlStatus, cls.told.append)
        cls.begin('console_hold_script.py', name='')
        cls.browser.driver.set_script_timeout(60)

    @classmethod
    def start_console(cls, *more):
        return super().start_console('_token_file:=' + cls.tokens, *more)

    @classmethod
    def start_robot(cls, robot, *arguments):
        return Node(
            find_node('smach_oracle', 'oracle_run')[0],
            '--config',
            cls.config,
            os.path.join(HERE, robot),
            '__name:=alpha',
        )

    def stands(self, words):
        self.assertTrue(self.browser.says(words, STANDING), self.browser.text())

    def commands(self):
        """Without those that command nothing."""
        return [
            (each.command, each.role, each.ok)
            for each in self.audited
            if '_machine' in each.command or each.command in ('confirm_state', 'set_breakpoint')
        ]

    @staticmethod
    def outcomes():
        return rospy.get_param('/alpha/outcomes', [])

    def test_1_who_may_only_look_and_has_no_name_stops_the_machine_at_once(self):
        browser = self.browser
        self.sign_in_to_machines('viewer')
        self.assertEqual(self.press_at_once(STOP), 0, 'nothing delays it')
        self.assertTrue(wait_for(lambda: self.outcomes() == ['preempted']), self.audited)
        self.assertTrue(browser.says(MACHINE + ' is asked to stop', '.hand-reply'))
        self.assertEqual(self.commands(), [('stop_machine', 'viewer', True)])
        self.assertIn('no emergency stop', browser.text('.machine-hand'))
        self.stands('Runs: FIRST in ' + MACHINE)

    def test_2_such_a_person_has_it_wait_and_does_not_let_it_go_on(self):
        browser = self.browser
        browser.click(PAUSE)
        self.stands('Paused by somebody at 127.0.0.1. Runs to its end: FIRST in ' + MACHINE)
        self.assertFalse(browser.find(RESUME).is_enabled())
        self.assertIn('needs the role of an operator', browser.text('.go-on'))
        self.assert_accessible('a machine that is paused, for a viewer')
        self.assertTrue(wait_for(lambda: not browser.text('.hand-reply')), 'it is said once')
        browser.run('document.querySelector("{}").disabled = false'.format(RESUME))
        browser.click(RESUME)
        browser.find('.name-demand #expert').send_keys('ann')
        browser.click('.name-demand #save-name')
        self.assertTrue(browser.says('viewers may not resume machine', '.machine-hand .problem'))
        browser.click('#person')
        browser.click('dialog button')

    def test_3_what_will_run_is_said_and_is_not_run_by_a_second_tap(self):
        browser = self.browser
        rospy.set_param('/alpha/done', ['FIRST'])
        self.sign_in_to_machines('operator')
        refused = self.press_at_once(RESUME)
        self.assertEqual(refused, 1, 'it had just come there')
        self.stands('Waits before SECOND in ' + MACHINE)
        self.assertEqual(browser.text(RESUME), 'Resume: SECOND in {} will run'.format(MACHINE))
        self.assertTrue(self.told[-1].machines[0].paused)
        self.assert_accessible('a machine that is paused')
        browser.click(RESUME)
        self.assertTrue(browser.says('runs now: SECOND in ' + MACHINE, '.hand-reply'))
        self.stands('Runs: SECOND in ' + MACHINE)

    def test_4_breakpoints_steps_and_confirmations(self):
        browser = self.browser
        browser.click('.breakpoints summary')
        self.assert_accessible('breakpoints')
        browser.find('.breakpoints input').send_keys('THIRD')
        browser.click('.breakpoints form button')
        browser.find('[data-breakpoint=THIRD]')
        rospy.set_param('/alpha/done', ['FIRST', 'SECOND', 'THIRD'])
        self.stands('Paused by breakpoint THIRD. Waits before THIRD in {}/INNER.'.format(MACHINE))
        browser.click(STEP)
        self.stands('Waits before FOURTH in {}/INNER.'.format(MACHINE))
        browser.click('[data-breakpoint=THIRD]')
        self.assertTrue(wait_for(lambda: not self.told[-1].machines[0].breakpoints))
        browser.click(RESUME)
        self.assertTrue(browser.says('still to be confirmed: FOURTH', '.hand-reply'))
        self.assertTrue(wait_for(lambda: not self.told[-1].machines[0].paused), 'it says so')
        self.assertTrue(
            browser.says('Confirm: FOURTH in {}/INNER will run'.format(MACHINE), CONFIRM)
        )
        browser.click(CONFIRM)
        self.stands('Runs: FOURTH in {}/INNER.'.format(MACHINE))
        browser.click(PAUSE)
        self.stands('Paused by ann.')
        browser.click(STOP)
        self.assertTrue(wait_for(lambda: self.outcomes() == ['preempted'] * 2))
        self.assertEqual(browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_hold')
    rostest.rosrun('smach_oracle', 'console_hold', Hold)
