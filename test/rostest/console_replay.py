#!/usr/bin/env python3
"""The last seconds before a failure, beside its question, in a real browser: images frame by frame,
what happened, joints, by mouse and by keyboard, calm where motion is not wanted, and with a hostile
robot.
"""

import os
import sys
import threading
import time
import unittest

import cv2
import numpy as np
import rospy
import rostest
from sensor_msgs.msg import CompressedImage, Image, JointState
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from waiting import wait_for

from smach_oracle.msg import FailureReplay, OracleEvent
from smach_oracle.ros.images import colour_image

EYE, HAND = '/alpha/eye/image_raw', '/alpha/hand/image_raw'
CARD = '.last-seconds:not([hidden])'
PERIOD_S = 0.1
STATE = """const card = document.querySelector('.last-seconds');
const at = (name) => card.querySelector('[data-replay=' + name + ']');
return { t: Number(at('scrubber').value), says: at('scrubber').getAttribute('aria-valuetext'),
  frame: Number(card.querySelector('canvas.image').dataset.frame ?? -1),
  play: at('play').getAttribute('aria-label'), marks: card.querySelectorAll('.last-marks i').length,
  landmarks: card.querySelectorAll('.landmark').length,
  words: card.querySelector('.last-words').textContent,
  legend: card.querySelector('.plot-legend').textContent,
  note: card.querySelector('.screen .view-note').textContent };"""
SEEK = """const slider = document.querySelector('.last-seconds [data-replay=scrubber]');
slider.value = arguments[0]; slider.dispatchEvent(new Event('input'));"""
KEY = """document.querySelector('.last-seconds [data-replay=scrubber]').dispatchEvent(
  new KeyboardEvent('keydown', { key: arguments[0], bubbles: true, cancelable: true }));"""
WIDE = """return document.documentElement.scrollWidth <= window.innerWidth
  && [...document.querySelectorAll('.last-seconds *')].every((each) => (
    each.getBoundingClientRect().right <= window.innerWidth + 1));"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Replay(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.set_param('/alpha/failure_cameras', [EYE, HAND])
        rospy.set_param('/alpha/replay_joints', ['/alpha/joint_states'])
        rospy.set_param('/alpha/oracle', {'policy': 'always_ask'})
        rospy.set_param('/alpha/replay_rate', 10)
        cls.images = [rospy.Publisher(topic, Image, queue_size=1) for topic in (EYE, HAND)]
        cls.joints = rospy.Publisher('/alpha/joint_states', JointState, queue_size=1)
        threading.Thread(target=cls.stream, daemon=True).start()
        cls.begin('failure_replay_robot.py', '1')

    @classmethod
    def stream(cls):
        for number in range(10**9):
            if rospy.is_shutdown():
                return
            header = Header(stamp=rospy.Time.now())
            shade = np.full((96, 128, 3), number * 5 % 200, np.uint8)
            cv2.putText(shade, str(number), (4, 60), 0, 1.5, (255, 255, 255), 2)
            for publisher in cls.images:
                publisher.publish(colour_image(shade, header))
            angle = np.sin(number / 5)
            cls.joints.publish(JointState(header, ['elbow', 'wrist'], [angle, 0.1 * angle], [], []))
            rospy.rostime.wallsleep(PERIOD_S)  # the rate of the streams

    def state(self):
        return self.browser.run(STATE)

    def becomes(self, **wanted):
        """Wait until the card stands so."""

        def stands():
            found = self.state()
            return all(
                value(found[name]) if callable(value) else found[name] == value
                for name, value in wanted.items()
            )

        self.assertTrue(wait_for(stands, 20.0), (wanted, self.state()))

    def test_1_a_question_shows_the_moment_of_its_failure(self):
        self.browser.click('.question-row', 60.0)
        self.browser.find(CARD, 20.0)
        self.becomes(t=0, says='at the failure', frame=lambda frame: frame >= 0, play='Play')
        self.assertIn('PICK', self.state()['words'])
        self.assertEqual(self.state()['landmarks'], 1)
        self.assertTrue(self.state()['legend'].startswith('elbow'), 'it moved most')
        self.assert_accessible('the last seconds')

    def test_2_images_are_shown_frame_by_frame(self):
        latest = self.state()['frame']
        self.browser.click(CARD + ' [data-replay=back]')
        self.becomes(frame=lambda frame: 0 <= frame < latest, t=lambda t: t < 0)
        before = self.state()
        self.assertIn('s before the failure', before['says'])
        self.browser.click(CARD + ' [data-replay=back]')
        self.becomes(frame=lambda frame: 0 <= frame < before['frame'])
        self.browser.click(CARD + ' [data-replay=on]')
        self.becomes(frame=before['frame'])
        self.browser.click(CARD + ' [data-replay=first]')
        # frames are those of both cameras, and either may have been heard first
        self.becomes(t=lambda t: -30 <= t <= -2, frame=lambda frame: frame < 4)
        self.browser.click(CARD + ' [data-replay=last]')
        self.becomes(t=0, frame=latest)

    def test_3_it_plays_and_pauses_by_mouse_and_by_key(self):
        self.browser.run(SEEK, -2)
        self.browser.click(CARD + ' [data-replay=play]')
        self.becomes(play='Pause', t=lambda t: t > -1.8)
        self.browser.run(KEY, ' ')
        self.becomes(play='Play')
        paused = self.state()['t']
        time.sleep(0.5)  # that it does not go on cannot be awaited
        self.assertEqual(self.state()['t'], paused)
        self.browser.run(KEY, ' ')
        self.becomes(play='Play', t=0, words=lambda words: 'PICK' in words)

    def test_4_the_other_camera(self):
        self.assertEqual(
            self.browser.run(
                "const choice = document.querySelector('.last-seconds select');"
                'const values = [...choice.options].map((each) => each.value);'
                "choice.value = values[1]; choice.dispatchEvent(new Event('change'));"
                'return values;'
            ),
            [EYE, HAND],
        )
        label = "return document.querySelector('.last-seconds canvas').getAttribute('aria-label')"
        self.assertTrue(wait_for(lambda: HAND in self.browser.run(label)))

    def test_5_with_little_motion_it_goes_from_image_to_image(self):
        driver = self.browser.driver
        reduced = [{'name': 'prefers-reduced-motion', 'value': 'reduce'}]
        driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': reduced})
        latest = self.state()['frame']
        self.browser.run(SEEK, -1.5)
        self.becomes(t=-1.5, frame=lambda frame: frame < latest)
        before = self.state()['frame']
        self.browser.click(CARD + ' [data-replay=play]')
        time.sleep(0.6)  # that nothing moves cannot be awaited
        self.assertEqual(self.state()['t'], -1.5)
        self.becomes(frame=lambda frame: frame > before)
        self.browser.click(CARD + ' [data-replay=play]')
        self.becomes(play='Play')
        driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': []})

    def test_6_it_fits_every_width(self):
        for width in (390, 768, 1024, 1440, 2560):
            metrics = dict(width=width, height=900, deviceScaleFactor=1, mobile=width < 800)
            self.browser.driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', metrics)
            self.assertTrue(wait_for(lambda: self.browser.run(WIDE), 5.0), width)
        self.browser.driver.execute_cdp_cmd('Emulation.clearDeviceMetricsOverride', {})

    def test_7_a_hostile_robot_harms_nobody(self):
        """In its place somebody publishes nonsense for the same question."""
        first = rospy.wait_for_message('/alpha/failure_replay', FailureReplay, 20.0)
        at = first.header.stamp
        self.robot.kill()
        hostile = rospy.Publisher('/alpha/failure_replay', FailureReplay, queue_size=1, latch=True)
        words = '<img src=x onerror="document.body.dataset.harmed = 1">'
        event = OracleEvent(
            kind=OracleEvent.FAILURE, header=Header(stamp=at), state=words, outcome=words
        )
        hostile.publish(
            FailureReplay(
                header=Header(stamp=at),
                query_id=first.query_id,
                seconds=float('nan'),
                topics=[words],
                cameras=b'\0\0\x09',
                images_came=[at] * 3,
                images=[CompressedImage(data=b'\xff\xd8broken')] * 3,
                events=[event] * 1000,
            )
        )
        self.assertFalse(self.browser.run('return document.body.dataset.harmed'))
        self.assertTrue(self.page_is_served())
        self.assertEqual([error for error in self.browser.errors() if '422' not in str(error)], [])


if __name__ == '__main__':
    rospy.init_node('console_replay')
    rostest.rosrun('smach_oracle', 'console_replay', Replay)
