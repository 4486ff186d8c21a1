#!/usr/bin/env python3
"""All robots on one page: those that need help first, their health, and stops of one, of several
and of all. Real robots, a real browser.
"""

import os
import subprocess
import sys
import time
import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import BatteryState

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from console_page import WITH_BROWSER, ConsolePage
from waiting import wait_for

from smach_oracle.msg import ConsoleCommand, OracleEvent

CARD = '.fleet-card[data-robot="{}"]'
ALPHA = CARD.format('/alpha')
ASKING = 3


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Robots(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.audited = []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        cls.preempted = []
        rospy.Subscriber(
            '/alpha/oracle/events',
            OracleEvent,
            lambda event: event.kind == OracleEvent.PREEMPT and cls.preempted.append(event.path),
        )
        battery = rospy.Publisher('/alpha/battery', BatteryState, queue_size=1, latch=True)
        battery.publish(percentage=0.12, voltage=21.3)
        parts = rospy.Publisher('/diagnostics', DiagnosticArray, queue_size=1, latch=True)
        motor = DiagnosticStatus(level=2, name='robot_1: left motor', message='over temperature')
        parts.publish(status=[motor])
        cls.publishers = battery, parts
        cls.asking = subprocess.Popen(
            [sys.executable, os.path.join(HERE, 'console_fleet_robots.py'), str(ASKING)]
        )
        cls.begin('console_robot.py', 'NONE', '0.5', '40', '9')
        cls.browser.click('#tab-fleet')

    @classmethod
    def tearDownClass(cls):
        cls.asking.terminate()
        cls.asking.wait(20)
        super().tearDownClass()

    def ended(self, number):
        """Its WORK has raised an error, with which its program ends once the machine is stopped."""
        topic = '/robot_{}/oracle/events'.format(number)
        return topic not in dict(rospy.get_published_topics())

    def test_1_those_that_need_help_come_first_with_state_question_and_health(self):
        browser = self.browser
        for number in range(ASKING):
            card = CARD.format('/robot_{}'.format(number))
            self.assertTrue(browser.says('needs an answer', card))
            self.assertTrue(browser.says('WORK failed', card + ' .fleet-question'))
        self.assertTrue(browser.says('runs', ALPHA))
        self.assertTrue(browser.says('Battery low: 12%, 21.3 V', ALPHA))
        self.assertTrue(browser.says('est. ', ALPHA + ' .fleet-state'), 'how often its state fails')
        self.assertTrue(browser.says(' ago', ALPHA + ' .fleet-last'))
        self.assertTrue(
            browser.says('left motor: over temperature', CARD.format('/robot_1') + ' .error')
        )
        self.assertTrue(browser.says('4 robots. 4 need help.', '.fleet-summary'))
        order = 'return [...document.querySelectorAll(".fleet-card")].map((e) => e.dataset.robot)'
        self.assertTrue(wait_for(lambda: browser.run(order)[-1] == '/alpha'), browser.run(order))
        self.assert_accessible('all robots')

    def test_2_a_card_leads_to_the_question_and_to_the_machine(self):
        browser = self.browser
        browser.click(CARD.format('/robot_0') + ' .fleet-question a')
        browser.find('.detail[data-question^="/robot_0/"]')
        browser.driver.back()
        browser.click(ALPHA + ' .fleet-name')
        self.assertTrue(browser.says('KITCHEN', '.machine-card h2'))
        browser.driver.back()
        browser.find(ALPHA)

    def test_3_a_paused_robot_says_what_will_run_before_it_is_resumed(self):
        browser = self.browser
        browser.click(ALPHA + ' [data-action=pause-robot]')
        self.assertTrue(browser.says('paused', ALPHA))
        resume = ALPHA + ' [data-action=resume-robot]'
        self.assertTrue(browser.says('in KITCHEN will run', resume))
        state = browser.text(resume).split()[1]
        browser.click(resume)
        self.assertTrue(browser.says('runs', ALPHA))
        self.assertTrue(browser.says('/alpha: ', '.fleet-reply'))
        self.assertIn(state, browser.text('.fleet-reply'))

    def test_4_those_that_were_chosen_are_stopped_and_no_other(self):
        browser = self.browser
        for number in (0, 1):
            browser.click(CARD.format('/robot_{}'.format(number)) + ' input')
        self.assertEqual(browser.text('[data-action=stop-chosen]'), '■ Stop 2 chosen')
        browser.click('[data-action=stop-chosen]')
        self.assertTrue(wait_for(lambda: self.ended(0) and self.ended(1)))
        self.assertFalse(self.ended(2))
        self.assertTrue(browser.says('Asked to stop: 2 of 2.', '.fleet-reply'))
        self.assertTrue(browser.says('runs', ALPHA))

    def test_5_all_are_stopped_at_once_though_one_of_them_hangs(self):
        self.robot.freeze()
        try:
            begun_s = time.monotonic()
            self.browser.click('[data-action=stop-all]')
            self.assertTrue(wait_for(lambda: self.ended(2)))
            self.assertEqual(self.preempted, [])
            self.assertLess(time.monotonic() - begun_s, 5.0)
            self.assertTrue(self.browser.says('/alpha has not answered', '.fleet-reply'))
        finally:
            self.robot.thaw()
        self.assertTrue(wait_for(lambda: self.preempted), 'it was stopped as well')
        told = [each.command for each in self.audited]
        self.assertEqual(told.count('stop_robots'), 2)
        self.assertEqual(self.browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_robots')
    rostest.rosrun('smach_oracle', 'console_robots', Robots)
