#!/usr/bin/env python3
"""The situation now and the past, in a real browser: preconditions, the camera at the failure,
replay, and old bags.
"""

import os
import sys
import unittest

import rosbag
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage, Node
from published_camera import PublishedCamera
from waiting import wait_for

from smach_oracle.experiment.launching import free_port
from smach_oracle.msg import ExpertQueryGoal, FailureFrames, InterfaceOutput, OpenQueries
from smach_oracle.simulation.scenes.scene import Body

if WITH_BROWSER:
    from browser import Browser
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys
TABLE = Body('table', 'box', (0.7, 1.4, 0.04), (0.85, 0.0, 0.70), colour=(0.9, 0.1, 0.1))
CAMERA = '/head_camera/rgb/image_raw'
QUESTION = '.question-row[data-key^="/alpha/"]'
PICK = '.choice.goto[data-name=PICK]'
MIDDLE = (
    'const c = document.querySelector(arguments[0]); if (!c) return null; const p = '
    'c.getContext("2d")'
    '.getImageData(c.width / 2, c.height * 0.7, 1, 1).data; return [p[0], p[1], p[2]]'
)

# whether the cursor is on a minute of work, on a part of the axis around it; px of that minute
# before a wait of 15, on the whole axis and on the part; whether it is drawn where the cursor is
# far away; and on the whole axis again
ZOOMED = """
return import("/static/js/trials/timeline.js").then(({ Timeline }) => {
  const line = new Timeline({ pick() {}, seek() {}, key() {} });
  line.root.style.width = "900px";
  document.body.append(line.root);
  const events = [["state_start", 0], ["failure", 60], ["query_opened", 60],
    ["query_answered", 960]].map(([kind, t], seq) => (
    { seq, kind, t, path: "TOP", state: "PICK", words: kind }));
  const width = () => Number(line.root.querySelector("rect.bar.bad")?.getAttribute("width") || 0);
  const sides = (part) => line.root.querySelector(part).getBoundingClientRect();
  line.set(events, 960);
  line.place(30, "");
  const found = [width()];
  line.zoom(16);
  found.push(width());
  const bar = sides("rect.bar.bad");
  const on = [".cursor-handle", ".cursor-line"].map(sides).every(
    ({ left, right }) => left > bar.left && right < bar.right);
  line.place(900, "");
  found.push(width());
  line.zoom(0);
  found.push(width());
  line.root.remove();
  return [on, ...found];
});"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class SituationAndHistory(ConsolePage, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.port = free_port()
        cls.bags = cls.make_folder()
        with open(os.path.join(cls.bags, 'torn.bag'), 'wb') as file:
            file.write(b'#ROSBAG V2.0\n' + b'\xff' * 200)
        rospy.set_param('/alpha/record', cls.bags)
        rospy.set_param('/alpha/failure_cameras', [CAMERA])
        cls.camera = PublishedCamera('head_camera', [TABLE], streams=True)
        cls.open = []
        cls.printed = rospy.Publisher('/alpha/interface_output', InterfaceOutput, queue_size=1)
        rospy.Subscriber('/alpha/expert_query/open', OpenQueries, cls.open.append)
        cls.robot = Node(
            sys.executable,
            os.path.join(os.path.dirname(os.path.abspath(__file__)), 'console_history_robot.py'),
            '__name:=alpha',
        )
        cls.console = cls.start_console()
        cls.browser = Browser(1360, 1000, whole=False)
        wait_for(cls.page_is_served, 40.0)
        cls.browser.driver.get('http://localhost:{}/'.format(cls.port))
        cls.remember_name(cls.browser, 'operator')

    @classmethod
    def start_console(cls, *more):
        return super().start_console('_bags:=' + cls.bags, *more)

    def question(self) -> ExpertQueryGoal:
        self.assertTrue(wait_for(lambda: self.open and self.open[-1].queries, 30.0))
        return self.open[-1].queries[0].query

    def test_1_preconditions_are_told_as_they_stand_now(self):
        browser = self.browser
        browser.click(QUESTION, 40.0)
        self.assertTrue(browser.says('hand_is_free does not hold', PICK))
        told = browser.text(PICK)
        self.assertIn("camera_answers unknown: raised RuntimeError('no <b>camera</b>')", told)
        self.assertIn('DETECT unknown: only running it would tell; its last visit succeeded', told)
        self.assertTrue(
            browser.says('has not come back for', '.choice.goto[data-name=PLACE]'),
            'and holds nobody up',
        )
        rospy.set_param('/alpha/hand_is_free', True)
        self.assertTrue(
            browser.says('hand_is_free holds', PICK),
            'what changes is told while the question is open',
        )
        self.assertIn('as of', browser.text(PICK))
        self.assert_accessible('preconditions')
        self.assertEqual(
            rospy.get_param('/alpha/looked_at_the_door'), 1, 'what hangs is not called again'
        )

    def test_2_the_frame_of_the_failure_is_there_and_a_live_one_beside_it(self):
        browser = self.browser
        frames = rospy.wait_for_message('/alpha/failure_frames', FailureFrames, 20.0)
        self.assertEqual((frames.query_id, frames.topics), (self.question().query_id, [CAMERA]))
        self.assertTrue(wait_for(lambda: browser.run(MIDDLE, '.failure-image.shown canvas')))
        self.assertEqual(browser.text('.failure-image figcaption .dim'), 'at the failure')
        self.assertTrue(wait_for(lambda: self.printed.get_num_connections()))
        self.printed.publish(InterfaceOutput(query_id=frames.query_id, lines=['ready']))
        red = browser.run(MIDDLE, '.failure-image canvas')
        self.assertGreater(red[0], red[2] + 40)
        self.camera.show([TABLE._replace(colour=(0.1, 0.1, 0.9))])
        browser.click('[data-action=live-camera]')
        self.assertTrue(
            wait_for(
                lambda: (lambda now: now and now[2] > now[0] + 40)(
                    browser.run(MIDDLE, '.pane.now .camera-view.shown canvas')
                )
            ),
            'the live one has changed',
        )
        self.assertEqual(browser.run(MIDDLE, '.failure-image canvas'), red, 'the other has not')

    def test_3_outputs_are_written_as_what_they_are(self):
        browser = self.browser
        browser.click('.outputs summary')
        fits = browser.find('[data-output=fits]')
        self.assertEqual(fits.tag_name, 'select', 'yes or no')
        self.assertEqual(fits.get_attribute('aria-label'), 'Value of fits: true or false')
        grasp = browser.find('[data-output=grasp]')
        self.assertEqual(grasp.get_attribute('aria-label'), 'Value of grasp: a JSON list')
        grasp.send_keys('{"a": 1}')
        browser.click('.choice.supersede[data-name=succeeded]')
        self.assertTrue(browser.says('grasp is a list', '.answer-form .problem'))
        grasp.clear()
        grasp.send_keys('[3, 4]')
        fits.send_keys('t')
        browser.click('.choice.supersede[data-name=succeeded]')
        self.assertTrue(browser.says('PICK counts as having ended with succeeded.', '.follow-up'))
        self.assertEqual(browser.errors(), [])

    def test_4_a_trial_is_replayed_from_its_bag_after_a_restart(self):
        browser = self.browser
        self.assertTrue(
            wait_for(lambda: [name for name in os.listdir(self.bags) if name.endswith('.bag')][1:])
        )
        with rosbag.Bag(
            os.path.join(self.bags, min(name for name in os.listdir(self.bags) if name[0] == '2'))
        ) as bag:
            told = {
                topic: message
                for topic, message, _ in bag.read_messages(
                    ['/alpha/interface_output', '/alpha/failure_frames']
                )
            }
        self.assertEqual(
            told['/alpha/interface_output'].lines, ['ready'], 'what interfaces print is in the bag'
        )
        self.assertEqual(told['/alpha/failure_frames'].topics, [CAMERA])
        type(self).console.stop()
        self.assertTrue(browser.says('connection lost', '#status'))
        type(self).console = self.start_console()
        self.assertTrue(browser.says('live', '#status', 40.0))
        browser.click('#tab-trials')
        browser.click('.trial[data-number]', 40.0)
        browser.click('.broken-bags summary')
        self.assertTrue(browser.says('torn.bag: damaged, or ', '.broken-bags li'))
        self.assertIn('Trials in the bags', browser.text('.panel.trials .table-frame'))
        self.assert_accessible('trials of bags')
        slider = browser.find('.replay [role=slider]')
        self.assertEqual(slider.get_attribute('aria-label'), 'Time in the trial')
        slider.send_keys(Keys.HOME)
        self.assertTrue(browser.says('The trial of FETCH began.', '.replay-words'))
        slider.send_keys(Keys.PAGE_UP)
        self.assertTrue(browser.says('PICK failed', '.replay-words'))
        self.assertIn('PICK failed', slider.get_attribute('aria-valuetext'))
        self.assertTrue(
            wait_for(lambda: self.classes('PICK') >= {'failed'}), 'in the graph of that trial'
        )
        self.assertLess(
            float(slider.get_attribute('aria-valuenow')),
            float(slider.get_attribute('aria-valuemax')),
        )
        self.assertTrue(browser.says('before the failure', '.replay .last-seconds h3'))
        self.assertTrue(
            wait_for(lambda: browser.run(MIDDLE, '.replay .last-seconds canvas.image[data-frame]')),
            'the last seconds, out of the bag',
        )
        slider.send_keys(Keys.PAGE_UP)
        self.assertTrue(browser.says('Question about PICK', '.replay-question'))
        self.assertTrue(browser.says('Not answered yet.', '.replay-question'))
        self.assertTrue(
            wait_for(lambda: browser.run(MIDDLE, '.replay-images .shown canvas')),
            'what was seen then',
        )
        self.assert_accessible('a replay')
        slider.send_keys(Keys.PAGE_UP)
        self.assertTrue(browser.says('Answer of operator: supersede succeeded', '.replay-question'))
        slider.send_keys(Keys.ARROW_LEFT)
        self.assertTrue(browser.says('Not answered yet.', '.replay-question'), 'one event back')

    def classes(self, label):
        return set(
            (
                self.browser.run(
                    'const e = document.getElementById(arguments[0]); return e && '
                    'e.getAttribute("class")',
                    'replayed/FETCH/' + label,
                )
                or ''
            ).split()
        )

    def test_5_it_plays_by_itself_and_follows_a_finger(self):
        browser = self.browser
        slider = browser.find('.replay [role=slider]')
        slider.send_keys(Keys.HOME)
        browser.run(
            'const speed = document.querySelector(".replay-speed"); speed.value = "0.25";'
            'speed.dispatchEvent(new Event("change"));'
        )
        browser.click('[data-replay=play]')
        self.assertTrue(
            wait_for(lambda: 'active' in self.classes('DETECT')), 'it has come to the first state'
        )
        browser.click('[data-replay=play]')
        stopped = slider.get_attribute('aria-valuenow')
        self.assertGreater(float(stopped), 0.0)
        right = int(slider.rect['width'] / 2) - 20
        ActionChains(browser.driver).move_to_element_with_offset(slider, right, 5).click().perform()
        self.assertTrue(
            wait_for(lambda: float(slider.get_attribute('aria-valuenow')) > float(stopped))
        )
        browser.click('.event-log .event:last-child')
        self.assertTrue(
            browser.says('The trial of FETCH began.', '.replay-words'),
            'a line of the log leads there',
        )
        self.assertEqual(browser.errors(), [])

    def test_9_a_part_of_the_time_axis_can_be_seen_larger(self):
        on, whole, part, elsewhere, again = self.browser.run(ZOOMED)
        self.assertTrue(on, 'the cursor is on the bar')
        self.assertGreater(part, 5 * whole)
        self.assertEqual((elsewhere, again), (0, whole))


if __name__ == '__main__':
    rospy.init_node('console_history')
    rostest.rosrun('smach_oracle', 'console_history', SituationAndHistory)
