#!/usr/bin/env python3
"""The console's eye in a real browser: an object marked with the mouse in a real interface, sensors
looked at, and a robot with its cloud in 3D."""

import os
import sys
import unittest

import numpy as np
import rospy
import rostest
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from published_camera import OPTICAL, PublishedCamera
from waiting import wait_for

from smach_oracle.msg import ConsoleCommand
from smach_oracle.ros.images import cloud_message
from smach_oracle.simulation.node.state_publisher import publish_description
from smach_oracle.simulation.scenes.scene import Body

if WITH_BROWSER:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys
TABLE = Body('table', 'box', (0.7, 1.4, 0.04), (0.85, 0.0, 0.70), colour=(0.55, 0.38, 0.22))
CAN = Body('can', 'cylinder', (0.031, 0.031, 0.12), (0.80, 0.10, 0.78), colour=(0.1, 0.3, 0.9))
BOX = Body('box', 'box', (0.05, 0.05, 0.14), (0.68, -0.15, 0.79), colour=(0.2, 0.8, 0.2))
CAN_INDEX = 1
QUESTION = '.question-row.pending[data-key^="/alpha/"]'  # an earlier one may still be about to go
CAMERA = '/head_camera/rgb/image_raw'
DEPTH = '/head_camera/depth_registered/image_raw'
DRAWN = (
    'const [view, name] = [document.querySelector(arguments[0]), arguments[1]];'
    'return view ? Number(view.dataset[name] || 0) : 0'
)
PICTURE = (
    'const view = document.querySelector(arguments[0]);'
    'const image = view.getContext("2d").getImageData(0, 0, view.width, view.height);'
    'const data = new Uint32Array(image.data.buffer);'
    'return [data.reduce((sum, each) => (sum * 31 + each) >>> 0, view.width),'
    ' data.reduce((sum, each) => sum + (each ? 1 : 0), 0)]'
)


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Marking(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        publish_description()
        cls.camera = PublishedCamera('head_camera', [TABLE, CAN, BOX], streams=True)
        cls.joints = rospy.Publisher('joint_states', JointState, queue_size=1, latch=True)
        cls.cloud = rospy.Publisher('points', PointCloud2, queue_size=1, latch=True)
        cls.audited = []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        cls.begin('console_marking_robot.py', size=(1360, 1000))

    def drag(self, *points):
        """With the mouse, over points of the frame in px."""
        canvas = self.browser.find('.perception .drawing')
        scale = canvas.size['width'] / 640.0
        middle = np.array([canvas.size['width'], canvas.size['height']]) / 2.0
        places = [np.rint(np.array(point, float) * scale - middle) for point in points]
        action = ActionChains(self.browser.driver, duration=20)
        action.move_to_element_with_offset(
            canvas, *(int(each) for each in places[0])
        ).click_and_hold()
        for place in places[1:]:
            action.move_to_element_with_offset(canvas, *(int(each) for each in place))
        action.release().perform()

    def around_the_can(self):
        rows, columns = np.nonzero(self.camera.pixels(CAN_INDEX))
        return (columns.min() - 8, rows.min() - 8), (columns.max() + 8, rows.max() + 8)

    def told(self, name):
        return [told for told in self.audited if told.command == name]

    def drawn(self, canvas, what):
        return self.browser.run(DRAWN, canvas, what)

    def assert_the_object_is_drawn_in_3d(self, canvas):
        own = int(self.browser.text('[data-fact=points]'))
        self.assertTrue(
            wait_for(lambda: self.drawn(canvas, 'points') > own + 5000), 'it, and what is around it'
        )
        self.assertTrue(
            wait_for(lambda: self.drawn(canvas, 'triangles') > 10000), 'the robot next to it'
        )
        before, pixels = self.browser.run(PICTURE, canvas)
        self.assertGreater(pixels, 5000)
        self.browser.find(canvas).send_keys(Keys.ARROW_LEFT)
        self.assertTrue(
            wait_for(lambda: self.browser.run(PICTURE, canvas)[0] != before), 'a key turns it'
        )

    def cross_to(self, point):
        """With the arrow keys, to a pixel of the image; 'It begins at' and the like tell where."""
        for axis, keys in enumerate(
            ((Keys.ARROW_LEFT, Keys.ARROW_RIGHT), (Keys.ARROW_UP, Keys.ARROW_DOWN))
        ):
            steps = int(point[axis] - self.cross[axis])
            ActionChains(self.browser.driver, duration=0).key_down(Keys.SHIFT).send_keys(
                *[keys[steps > 0]] * abs(steps)
            ).key_up(Keys.SHIFT).perform()
        self.cross = [int(each) for each in point]

    def stamp_of_image(self):
        return self.browser.run('return document.querySelector(".perception").dataset.stamp')

    def assert_a_region_is_marked_by_keys(self):
        browser, marked = self.browser, len(self.told('mark'))
        first, last = self.around_the_can()
        browser.run('document.querySelector(".perception .drawing").focus()')
        self.cross = [320, 240]
        self.cross_to(first)
        ActionChains(browser.driver, duration=0).send_keys(Keys.ENTER).perform()
        told = 'return document.getElementById("announcer").textContent'
        self.assertIn('It begins at {}, {} of 640 by 480'.format(*self.cross), browser.run(told))
        ActionChains(browser.driver, duration=0).send_keys(Keys.ESCAPE).perform()
        self.assertTrue(browser.find('.perception'), 'the line is taken back, not the question')
        ActionChains(browser.driver, duration=0).send_keys(Keys.ESCAPE).perform()
        self.assertTrue(browser.find('.perception'), 'the cross, too')
        self.cross = [320, 240]
        self.cross_to(first)
        ActionChains(browser.driver, duration=0).send_keys(' ').perform()
        self.cross_to(last)
        ActionChains(browser.driver, duration=0).send_keys(Keys.ENTER).perform()
        browser.find('[data-fact=size]')
        self.assertTrue(
            wait_for(lambda: [told.ok for told in self.told('mark')[marked:]] == [True]),
            'cut out once',
        )

    def test_1_an_object_is_marked_in_the_frame_and_the_machine_goes_on_with_it(self):
        browser = self.browser
        browser.click(QUESTION)
        browser.click('.choice.interface[data-name=perception]')
        browser.find('.perception.shown', 30.0)
        self.assertFalse(browser.find('.perception .accept').is_enabled(), 'nothing is marked yet')
        self.assert_accessible('an image to mark')
        self.drag(*self.around_the_can())
        browser.find('[data-fact=size]')
        middle = np.array(self.around_the_can(), float).mean(axis=0)
        self.assertTrue(
            wait_for(
                lambda: browser.run(
                    'return document.querySelector(".drawing").getContext("2d")'
                    '.getImageData(arguments[0], arguments[1], 1, 1).data[3]',
                    *(int(each) for each in middle),
                )
            ),
            'the mask lies over the object',
        )
        print(
            'from the end of the drawing to the mask on the screen: {} ms'.format(
                browser.run('return document.querySelector(".perception").dataset.shownAfter')
            )
        )
        self.assert_the_object_is_drawn_in_3d('.object-view .cloud')
        self.assert_accessible('a marked object')
        self.assert_wide_at(1024, '.perception .image', 350)
        browser.click('[data-tool=background]')
        left_top, right_bottom = self.around_the_can()
        self.drag(left_top, (right_bottom[0], left_top[1]))
        self.assertTrue(wait_for(lambda: len(self.told('mark')) == 2), 'a stroke cuts again')
        self.assertEqual([told.ok for told in self.told('mark')], [True, True])
        type(self).stamp = self.stamp_of_image()
        browser.click('.perception .accept')
        self.assertTrue(wait_for(lambda: rospy.has_param('/alpha/picked')))
        self.assertLess(
            np.linalg.norm(np.subtract(rospy.get_param('/alpha/picked'), CAN.position)), 0.02
        )
        self.assertTrue(
            browser.says('DETECT_TABLETOP counts as having ended with succeeded.', '.follow-up')
        )
        self.assertTrue(wait_for(lambda: self.told('hand_over')))
        self.assertEqual(
            [(told.ok, told.expert) for told in self.told('hand_over')], [(True, 'operator')]
        )
        self.assertTrue(
            self.told('hand_over')[0].query_id, 'it is told which question it was about'
        )
        self.assertEqual(browser.errors(), [])

    def test_2_giving_up_asks_again(self):
        browser = self.browser
        browser.click('.follow-up [data-action=back]')
        browser.click(QUESTION)
        browser.click('.choice.interface[data-name=perception]')
        browser.find('.perception.shown', 30.0)
        # at first the last image of before may be there, and a new one drops what was drawn on it
        self.assertTrue(wait_for(lambda: self.stamp_of_image() != self.stamp))
        self.assert_a_region_is_marked_by_keys()
        browser.click('.perception .quit')
        self.assertTrue(browser.says('It asks again', '.follow-up', 30.0))
        self.assertTrue(
            wait_for(lambda: not browser.text('.perception')),
            'the tools are gone with the interface',
        )

    def test_3_a_camera_is_listened_to_while_somebody_looks(self):
        browser = self.browser
        browser.click('#tab-sensors')
        self.assertTrue(wait_for(lambda: self.camera.viewers == 0))
        browser.click('[data-topic="{}"]'.format(CAMERA))
        browser.find('.camera-view.shown')
        self.assertTrue(
            wait_for(
                lambda: browser.run(
                    'const view = document.querySelector(".camera-view .image");'
                    'return view.width === 640 && view.getContext("2d").getImageData(320, 300, 1, '
                    '1).data[0] > 20'
                )
            )
        )
        self.assertEqual(self.camera.viewers, 1)
        self.assert_accessible('a camera')
        # as when a session has become too old while its page was open
        browser.driver.delete_all_cookies()
        self.camera.show([TABLE._replace(colour=(0.1, 0.1, 0.9))])
        self.assertTrue(
            wait_for(
                lambda: browser.run(
                    'const view = document.querySelector(".camera-view .image");'
                    'const [red, , blue] = view.getContext("2d")'
                    '.getImageData(320, 336, 1, 1).data; '
                    'return blue > red + 40'
                )
            )
        )
        self.camera.show([TABLE, CAN, BOX])
        self.assertTrue(any('401' in entry for entry in browser.errors()), 'it was refused once')
        browser.click('.camera-view .view-close')
        self.assertTrue(wait_for(lambda: self.camera.viewers == 0, 30.0), 'nobody looks any more')

    def test_4_clouds_and_joints_are_shown(self):
        browser = self.browser
        self.joints.publish(JointState(name=['elbow'], position=[1.25]))
        points = np.random.default_rng(1).uniform(-1, 1, (50000, 3))
        self.cloud.publish(
            cloud_message(points, Header(frame_id=OPTICAL), np.full(points.shape, 200, np.uint8))
        )
        browser.click('[data-topic="/joint_states"]')
        self.assertTrue(browser.says('1.250', '.joints-view'))
        self.assert_accessible('joints')
        browser.click('[data-topic="/points"]')
        self.assertTrue(browser.says('20000 of 50000 points', '.cloud-view'))
        # it is drawn with the next frame of the browser
        self.assertTrue(wait_for(lambda: browser.run(PICTURE, '.cloud-view .cloud')[1] > 1000))
        self.assertEqual(browser.errors(), [])

    def test_5_the_robot_stands_in_its_cloud_and_moves_as_its_joints_say(self):
        browser, canvas = self.browser, '.cloud-view .cloud'
        self.assertTrue(
            wait_for(
                lambda: (
                    self.drawn(canvas, 'triangles') > 10000
                    and self.drawn(canvas, 'points') == 20000
                )
            ),
            (
                self.drawn(canvas, 'triangles'),
                self.drawn(canvas, 'points'),
                browser.text('.cloud-view'),
            ),
        )
        self.assert_accessible('a cloud and its robot')
        before = browser.run(PICTURE, canvas)[0]
        self.joints.publish(
            JointState(name=['torso_lift_joint', 'l_shoulder_pan_joint'], position=[0.3, 1.5])
        )
        self.assertTrue(wait_for(lambda: browser.run(PICTURE, canvas)[0] != before))
        self.assertNotIn('No transform', browser.text('.cloud-view'))
        browser.run(
            'const choice = document.querySelector(".cloud-view .beside"); choice.value = "";'
            'choice.dispatchEvent(new Event("change"))'
        )
        self.assertTrue(wait_for(lambda: self.drawn(canvas, 'triangles') == 0), 'the cloud alone')
        self.assertEqual(browser.errors(), [])

    def test_6_where_there_is_depth_alone_the_console_makes_the_cloud(self):
        browser = self.browser
        for topic in ('/points', '/joint_states'):
            browser.click('.sensor-list [data-topic="{}"]'.format(topic))
        browser.click('.sensor-list [data-topic="{} as a cloud"]'.format(DEPTH))
        self.assertTrue(browser.says('of 307200 points', '.cloud-view'))
        self.assertTrue(
            wait_for(lambda: self.drawn('.cloud-view .cloud', 'triangles') > 10000),
            'with the robot',
        )
        # 422: the first image may have come before the first camera_info, and the page was told so
        self.assertEqual([entry for entry in browser.errors() if '422' not in entry], [])

    def test_6_a_robot_whose_cloud_came_first_stands_as_soon_as_its_transform_is_known(self):
        browser, view = self.browser, '.cloud-view[data-topic="/early"]'
        early = rospy.Publisher('early', PointCloud2, queue_size=1, latch=True)
        early.publish(
            cloud_message(
                np.random.default_rng(1).uniform(-1, 1, (500, 3)), Header(frame_id='early')
            )
        )
        browser.click('.sensor-list [data-topic="/early"]')
        self.assertTrue(browser.says('No transform from early', view), browser.text(view))
        self.assertEqual(self.drawn(view + ' .cloud', 'triangles'), 0)
        self.camera.tell_place('early')
        self.assertTrue(
            wait_for(lambda: self.drawn(view + ' .cloud', 'triangles') > 10000), browser.text(view)
        )
        browser.click('.sensor-list [data-topic="/early"]')

    def test_7_a_robot_description_that_would_do_harm_is_told_in_a_sentence(self):
        rospy.set_param(
            '/evil/robot_description',
            '<!DOCTYPE robot [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot/>',
        )
        evil = '[data-topic="/evil/robot_description"]'
        self.browser.click('.sensor-list ' + evil)
        self.assertTrue(self.browser.says('entities; that is not allowed', '.view' + evil))
        self.assertEqual([entry for entry in self.browser.errors() if '422' not in entry], [])


if __name__ == '__main__':
    rospy.init_node('console_marking')
    rostest.rosrun('smach_oracle', 'console_marking', Marking)
