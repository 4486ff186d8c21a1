#!/usr/bin/env python3
"""One expert, ten robots; two consoles on one robot. Real nodes, real consoles, one real
browser.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import unittest

import rospy
import rostest
from roslib.packages import find_node

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from waiting import wait_for

from smach_oracle.experiment.launching import free_port
from smach_oracle.msg import ConsoleCommand, ExpertDecision, OpenQueries
from smach_oracle.srv import AnswerQuery

WITH_BROWSER = bool(shutil.which('chromedriver'))
if WITH_BROWSER:
    from browser import Browser
    from selenium.webdriver.common.action_chains import ActionChains
ROBOTS = 10
LEASE_S = 15.0
ROW = '.question-row[data-key^="/robot_{}/"]'


def served(port):
    with socket.socket() as probe:
        return probe.connect_ex(('127.0.0.1', port)) == 0


class Console:
    """A console node of its own."""

    def __init__(self, name):
        self.port = free_port()
        self.audited = []
        self._subscriber = rospy.Subscriber(
            '/{}/audit'.format(name), ConsoleCommand, self.audited.append
        )
        self.process = subprocess.Popen(
            [
                find_node('smach_oracle', 'expert_console')[0],
                '_port:={}'.format(self.port),
                '__name:=' + name,
            ]
        )

    def told(self):
        return [(told.command, told.expert, told.robot, told.ok) for told in self.audited]

    def stop(self, how=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(how)
            self.process.wait(20)


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Fleet(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robots = subprocess.Popen(
            [
                sys.executable,
                os.path.join(os.path.dirname(os.path.abspath(__file__)), 'console_fleet_robots.py'),
                str(ROBOTS),
            ]
        )
        cls.first, cls.second = Console('console_a'), Console('console_b')
        cls.open, cls.audited = {}, []
        for number in range(ROBOTS):
            rospy.Subscriber(
                '/robot_{}/expert_query/open'.format(number),
                OpenQueries,
                lambda message, each=number: cls.open.update({each: message.queries}),
            )
        rospy.Subscriber('/robot_9/expert_query/audit', ConsoleCommand, cls.audited.append)
        cls.browser = Browser()
        wait_for(lambda: served(cls.first.port) and served(cls.second.port), 40.0)
        cls.browser.driver.get('http://localhost:{}/'.format(cls.first.port))

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.first.stop()
        cls.second.stop()
        cls.robots.terminate()
        cls.robots.wait(20)

    def holder(self, number):
        queries = self.open.get(number) or []
        return queries[0].claimed_by if queries else None

    def went(self, number):
        return rospy.get_param('/robot_{}/went'.format(number), [])

    def take(self):
        """Take the question that is shown: to read it takes nothing."""
        self.browser.click('[data-action=claim]')
        self.assertTrue(self.browser.says('It is yours.'))

    def name_oneself(self, name):
        browser = self.browser
        browser.click('#person')
        field = browser.find('#expert')
        field.clear()
        field.send_keys(name)
        browser.click('#save-name')
        self.assertTrue(browser.says(name, '#person'))

    def answer_elsewhere(self, *numbers):
        """As any other front end does."""
        before = int(self.browser.text('#tab-questions .badge'))
        for number in numbers:
            rospy.ServiceProxy('/robot_{}/expert_query/answer'.format(number), AnswerQuery)(
                self.open[number][0].query.query_id,
                ExpertDecision(
                    kind=ExpertDecision.GOTO, state='PLAN_{}'.format(number), by='somebody'
                ),
            )
        self.assertTrue(
            self.browser.says(str(before - len(numbers)), '#tab-questions .badge'), 'the page knows'
        )

    def hold(self, selector):
        """Press the mouse on it."""
        element = self.browser.find(selector)
        self.assertTrue(wait_for(lambda: self.browser.settled(element)))
        ActionChains(self.browser.driver, duration=0).click_and_hold(element).perform()

    def let_go(self):
        ActionChains(self.browser.driver, duration=0).release().perform()

    def test_1_what_is_pressed_or_focused_stays_while_the_questions_of_others_go(self):
        browser = self.browser
        for number in range(ROBOTS):
            browser.find(ROW.format(number), 60.0)
        self.assertTrue(browser.driver.title.startswith('(10)'))
        self.assertTrue(browser.says('10', '#tab-questions .badge'))
        self.name_oneself('ann')
        self.assertTrue(wait_for(lambda: len(self.open) == ROBOTS))
        self.hold(ROW.format(5))
        self.answer_elsewhere(0)
        self.let_go()
        self.assertTrue(
            browser.says('/robot_5 · JOB', '.detail-head'),
            'the list moved under the mouse, or the page refused the press ({} refused '
            'so far); it says:\n{}'.format(
                browser.run('return document.body.dataset.refused || 0'), browser.text()[:1500]
            ),
        )
        self.assertTrue(
            wait_for(
                lambda: browser.run('return !document.querySelector(arguments[0])', ROW.format(0))
            )
        )
        self.take()
        browser.run('document.querySelector(arguments[0]).focus()', ROW.format(6))
        self.answer_elsewhere(1)
        self.assertTrue(
            wait_for(
                lambda: browser.run('return !document.querySelector(arguments[0])', ROW.format(1))
            )
        )
        self.assertEqual(
            browser.run('return document.activeElement.dataset.key.split("/")[1]'), 'robot_6'
        )
        browser.click('#tab-machines')
        self.assertTrue(
            wait_for(
                lambda: (
                    len(
                        browser.run(
                            'return [...document.querySelectorAll(".picker .path")]'
                            '.map((each) => each.title)'
                        )
                    )
                    == ROBOTS
                )
            )
        )
        named = browser.text('.picker .group:nth-child(8) .robot')
        self.hold('.picker .group:nth-child(8) .path')
        self.answer_elsewhere(2)
        self.assertTrue(wait_for(lambda: rospy.get_param('/robot_2/ended', False)))
        self.let_go()
        self.assertTrue(
            browser.says(named, '.machine-card .head'), 'neither does the tree of machines'
        )
        browser.click('#tab-questions')
        self.assertEqual(browser.errors(), [])

    def test_2_ten_robots_ask_one_console_and_each_gets_its_own_answer(self):
        browser = self.browser
        by_console = (3, 7, 5, 6, 4)  # not as they have asked
        for number in by_console:
            browser.click(ROW.format(number))
            self.assertTrue(browser.says('/robot_{} · JOB'.format(number), '.detail-head'))
            self.assertIn(
                'RuntimeError: /robot_{} is stuck'.format(number), browser.text('.failure .text')
            )
            browser.click('.choice.goto[data-name=PLAN_{}]'.format(number))
            self.assertTrue(
                browser.says(
                    'The robot has your answer: go to PLAN_{}'.format(number), '.follow-up'
                )
            )
            browser.click('.follow-up [data-action=back]')
        self.assertTrue(
            wait_for(
                lambda: all(
                    rospy.get_param('/robot_{}/ended'.format(each), False) for each in range(8)
                )
            )
        )
        self.assertEqual(
            [self.went(number) for number in range(8)],
            [[number] for number in range(8)],
            'each went where it was sent',
        )
        self.assertEqual([self.went(number) for number in (8, 9)], [[], []], 'nobody else did')
        self.assertTrue(
            wait_for(
                lambda: (
                    [told[2] for told in self.first.told() if told[0] == 'answer' and told[3]]
                    == ['/robot_{}'.format(each) for each in by_console]
                )
            ),
            self.first.told(),
        )
        self.assertTrue(browser.says('2', '#tab-questions .badge'))

    def test_3_two_consoles_on_one_robot_take_over_is_explicit_and_logged(self):
        browser = self.browser
        browser.click(ROW.format(9))
        self.take()
        self.assertTrue(wait_for(lambda: self.holder(9) == 'ann'))
        browser.driver.switch_to.new_window('tab')
        browser.driver.get('http://localhost:{}/'.format(self.second.port))
        self.name_oneself('bob')
        self.assertTrue(browser.says('ann', ROW.format(9)), 'the queue says who works on it')
        browser.click(ROW.format(9))
        self.assertTrue(browser.says('ann works on it.'))
        self.assertFalse(browser.find('.choice.goto').is_enabled())
        self.assertEqual(self.holder(9), 'ann', 'to look at it takes nothing')
        browser.click('[data-action=take-over]')
        self.assertTrue(browser.says('It is yours.'))
        first, second = browser.driver.window_handles
        browser.driver.switch_to.window(first)
        self.assertTrue(browser.says('bob has taken this question over.'))
        self.assertFalse(browser.find('.choice.goto').is_enabled(), 'it is hers no longer')
        self.assertTrue(
            wait_for(
                lambda: (
                    ('take_over', 'bob') in [(told.command, told.expert) for told in self.audited]
                )
            ),
            'for the bag',
        )
        self.assertTrue(
            wait_for(lambda: ('take_over', 'bob', '/robot_9', True) in self.second.told())
        )
        self.assertNotIn('take_over', [told[0] for told in self.first.told()])

    def test_4_a_console_that_dies_loses_its_claim_with_the_lease(self):
        browser = self.browser
        browser.driver.switch_to.window(browser.driver.window_handles[0])
        browser.click(ROW.format(8))
        self.take()
        self.assertTrue(wait_for(lambda: self.holder(8) == 'ann'))
        self.first.stop(signal.SIGKILL)
        killed_s = time.monotonic()
        browser.driver.switch_to.window(browser.driver.window_handles[1])
        self.assertTrue(browser.says('ann', ROW.format(8)))
        browser.click('.choice.goto[data-name=PLAN_9]')
        self.assertTrue(browser.says('The robot has your answer: go to PLAN_9', '.follow-up'))
        self.assertTrue(wait_for(lambda: self.went(9) == [9]), 'meanwhile the other console works')
        browser.click('.follow-up [data-action=back]')
        self.assertTrue(
            browser.says('waiting', ROW.format(8), LEASE_S + 20.0), 'the claim has run out'
        )
        self.assertGreater(time.monotonic() - killed_s, 5.0)
        browser.click(ROW.format(8))
        browser.click('.choice.goto[data-name=PLAN_8]')
        self.assertTrue(wait_for(lambda: self.went(8) == [8]))
        self.assertTrue(
            wait_for(
                lambda: (
                    [told[1] for told in self.second.told() if told[0] == 'answer' and told[3]]
                    == ['bob', 'bob']
                )
            ),
            self.second.told(),
        )
        self.assertEqual(browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_fleet')
    rostest.rosrun('smach_oracle', 'console_fleet', Fleet)
