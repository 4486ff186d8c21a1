#!/usr/bin/env python3
"""Two robots with interfaces of the same names, each in a namespace: what a person marks and drives
in a question is its own robot's. Real interfaces, a real browser.
"""

import os
import sys
import unittest

import numpy as np
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import HERE, WITH_BROWSER, ConsolePage, Node
from published_camera import PublishedCamera
from teleoperation_fixtures import FakeArm
from waiting import stays, wait_for

from smach_oracle.simulation.scenes.scene import Body

if WITH_BROWSER:
    from selenium.webdriver.common.action_chains import ActionChains
TABLE = Body('table', 'box', (0.7, 1.4, 0.04), (0.85, 0.0, 0.70), colour=(0.55, 0.38, 0.22))
CAN = Body('can', 'cylinder', (0.031, 0.031, 0.12), (0.80, 0.10, 0.78), colour=(0.1, 0.3, 0.9))
CANS = {'/r1': CAN, '/r2': CAN._replace(position=(0.72, -0.20, 0.78))}
CAN_INDEX = 1
MARGIN = 8  # px
QUESTION = '.question-row[data-key^="{}/"]'


class Both:
    """The nodes of both robots."""

    def __init__(self, robot):
        self._nodes = [Node(sys.executable, robot, '__ns:=' + each) for each in CANS]

    def stop(self):
        """Ctrl-C, as from a shell."""
        for node in self._nodes:
            node.stop()


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class TwoRobots(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.arms = {robot: FakeArm(robot + '/') for robot in CANS}
        cls.cameras = {
            robot: PublishedCamera(robot + '/head_camera', [TABLE, can], streams=True)
            for robot, can in CANS.items()
        }
        cls.begin('console_two_robots_robot.py', size=(1360, 1000))

    @classmethod
    def start_robot(cls, robot, *arguments):
        return Both(os.path.join(HERE, robot))

    def open(self, robot, choice=''):
        """Open the question of a robot, and choose an interface or go on with the one that runs."""
        self.browser.click(QUESTION.format(robot))
        self.assertTrue(self.browser.says(robot + '/robot', '.stage'), 'it is that question')
        if choice:
            self.browser.click('.choice.interface[data-name={}]'.format(choice))

    def mark_the_can(self, robot):
        rows, columns = np.nonzero(self.cameras[robot].pixels(CAN_INDEX))
        canvas = self.browser.find('.perception .drawing')
        size = np.array([canvas.size['width'], canvas.size['height']])
        corners = np.array(
            [
                (columns.min() - MARGIN, rows.min() - MARGIN),
                (columns.max() + MARGIN, rows.max() + MARGIN),
            ]
        )
        first, last = np.rint(corners * size[0] / 640.0 - size / 2.0).astype(int).tolist()
        drag = ActionChains(self.browser.driver, duration=20)
        drag.move_to_element_with_offset(canvas, *first).click_and_hold()
        drag.move_to_element_with_offset(canvas, *last).release().perform()

    def has_moved(self):
        """Which arms move while a second passes."""
        before = {robot: arm.moved_s for robot, arm in self.arms.items()}
        wait_for(lambda: any(self.arms[robot].moved_s > before[robot] + 0.3 for robot in CANS), 1.0)
        return [robot for robot, arm in self.arms.items() if arm.moved_s > before[robot]]

    def take_the_wheel(self, robot):
        self.open(robot)
        self.browser.find('.manipulation', 40.0)
        self.browser.click('.wheel')
        self.assertTrue(self.browser.says('You drive.', '.driver'))
        self.browser.click('[data-frame=base]')

    def test_1_what_is_marked_is_the_object_of_the_robot_that_has_asked(self):
        browser = self.browser
        for robot in CANS:
            self.open(robot, 'perception')
            browser.find('.perception.shown', 30.0)
        for robot, can in CANS.items():
            self.open(robot)
            browser.find('.perception.shown', 30.0)
            self.mark_the_can(robot)
            browser.find('[data-fact=size]')
            browser.click('.perception .accept')
            picked = robot + '/robot/picked'
            self.assertTrue(wait_for(lambda name=picked: rospy.has_param(name)))
            self.assertLess(
                np.linalg.norm(np.subtract(rospy.get_param(picked), can.position)), 0.02
            )
        self.assertEqual(browser.errors(), [])

    def test_2_the_hand_is_the_one_of_the_robot_that_has_asked(self):
        browser = self.browser
        for robot in CANS:
            self.open(robot, 'manipulation')
            browser.find('.manipulation', 40.0)
        self.take_the_wheel('/r1')
        browser.hold('r')
        self.assertEqual(self.has_moved(), ['/r1'])
        browser.click(QUESTION.format('/r2'))  # the key is still held
        browser.find('.manipulation', 40.0)
        moved = [arm.moved_s for arm in self.arms.values()]
        self.assertTrue(
            stays(lambda: [arm.moved_s for arm in self.arms.values()] == moved, 1.0),
            'neither is driven by a key that was pressed for the other',
        )
        ActionChains(browser.driver, duration=0).key_up('r').perform()
        self.take_the_wheel('/r2')
        browser.hold('r')
        self.assertEqual(self.has_moved(), ['/r2'])
        ActionChains(browser.driver, duration=0).key_up('r').perform()
        self.assertEqual(browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_two_robots')
    rostest.rosrun('smach_oracle', 'console_two_robots', TwoRobots)
