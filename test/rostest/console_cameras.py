#!/usr/bin/env python3
"""Whose camera a question shows, and how old its images are, in a real browser: /alpha has none of
its own at first, and a latched image an hour old.
"""

import os
import sys
import threading
import unittest

import numpy as np
import rospy
import rostest
from sensor_msgs.msg import Image
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from waiting import wait_for

from smach_oracle.ros.images import colour_image

QUESTION = '.question-row[data-key^="/alpha/"]'
FOREIGN, LATCHED, OWN = (
    '/beta/camera/image_raw',
    '/alpha/latched/image_raw',
    '/hall/camera/image_raw',
)
HOUR_S = 3600.0
TOPICS = """return [...document.querySelectorAll(
  ".situation-camera option, .situation-camera .view")].map((each) => (
  each.value || each.dataset.topic))"""


def picture(stamp, level=90):
    return colour_image(np.full((48, 64, 3), level, np.uint8), Header(stamp=stamp))


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Cameras(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.foreign = rospy.Publisher(FOREIGN, Image, queue_size=1)
        cls.own = rospy.Publisher(OWN, Image, queue_size=1)
        threading.Thread(target=cls.stream, daemon=True).start()
        cls.begin('console_robot.py', 'PICK', '0.1', '0', '9')

    @classmethod
    def stream(cls):
        while not rospy.is_shutdown():
            for publisher in (cls.foreign, cls.own):
                publisher.publish(picture(rospy.Time.now()))
            rospy.rostime.wallsleep(0.2)  # five pictures a second

    def shown(self):
        return set(self.browser.run(TOPICS))

    def test_1_a_robot_without_a_camera_is_shown_none(self):
        browser = self.browser
        browser.click('#tab-sensors')
        self.assertTrue(browser.says(FOREIGN[1:]), 'the console knows it')
        browser.click('#tab-questions')
        browser.click(QUESTION)
        self.assertTrue(browser.says('No camera of its own.', '.situation-camera'))
        self.assertEqual(self.shown(), set())

    def test_2_a_latched_image_is_as_old_as_its_stamp_says(self):
        browser = self.browser
        latched = rospy.Publisher(LATCHED, Image, queue_size=1, latch=True)
        latched.publish(picture(rospy.Time.now() - rospy.Duration(HOUR_S)))
        self.assertTrue(wait_for(lambda: self.shown() == {LATCHED}), "it bears the robot's name")
        browser.click('[data-action=live-camera]')
        self.assertTrue(browser.says('1:0', '.pane.now .image-age.old'), browser.text('.pane.now'))
        self.assertIn('h old', browser.text('.pane.now .image-age'))
        latched.unregister()

    def test_3_its_failure_cameras_are_its_own_and_a_live_image_is_new(self):
        browser = self.browser
        rospy.set_param('/alpha/failure_cameras', [OWN])
        self.assertTrue(wait_for(lambda: OWN in self.shown()))
        self.assertNotIn(FOREIGN, self.shown())
        self.assertTrue(
            wait_for(
                lambda: (
                    browser.run(
                        'const choice = document.querySelector(".situation-camera select");'
                        'choice.value = arguments[0];'
                        'choice.dispatchEvent(new Event("change")); return choice.value',
                        OWN,
                    )
                    == OWN
                )
            )
        )
        self.assertTrue(
            browser.says('s old', '.pane.now .image-age:not(.old)'), browser.text('.pane.now')
        )
        self.assertEqual(browser.errors(), [])

    def test_4_the_setting_goes_before_all_else(self):
        type(self).console.stop()
        rospy.set_param('/expert_console/cameras', {'/alpha': ['/beta']})
        type(self).console = self.start_console()
        self.assertTrue(wait_for(self.page_is_served))
        self.browser.driver.refresh()
        self.browser.click(QUESTION)
        self.assertTrue(wait_for(lambda: FOREIGN in self.shown()))
        self.assertNotIn(OWN, self.shown())


if __name__ == '__main__':
    rospy.init_node('console_cameras')
    rostest.rosrun('smach_oracle', 'console_cameras', Cameras)
