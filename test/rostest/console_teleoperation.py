#!/usr/bin/env python3
"""A hand driven from a real browser, by held keys and buttons, through an interface that is started
on demand.
"""

import os
import sys
import threading
import time
import unittest
from functools import partial

import numpy as np
import rospy
import rostest
from sensor_msgs.msg import Image
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from console_page import WITH_BROWSER, ConsolePage
from machine_lag import MachineLag
from teleoperation_fixtures import FakeArm
from waiting import assert_soon, stays, wait_for

from smach_oracle.msg import ConsoleCommand, TeleopCommand, TeleopState
from smach_oracle.ros.images import colour_image

if WITH_BROWSER:
    from browser import Browser
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys
HERE = os.path.dirname(os.path.abspath(__file__))
STOPS_WITHIN_S = 0.1
QUEUED = 2  # commands that the console's publisher may hold
QUESTION = '.question-row[data-key^="/alpha/"]'
# a button that has just moved, held by a key
HELD_AT_ONCE = """
const pad = document.querySelector(".pad[data-move=up]");
const box = document.createElement("div");
box.style.height = "60px";
pad.parentElement.before(box);
const key = { key: " ", code: "Space", bubbles: true, cancelable: true };
pad.dispatchEvent(new KeyboardEvent("keydown", key));
box.remove();"""

# the wheel is taken, and a letter pressed in the very frame in which it comes to move the hand
KEY_AT_ONCE = """
const done = arguments[0];
const wheel = document.querySelector(".wheel");
const pad = document.querySelector(".pad[data-move=up]");
const refused = () => Number(document.body.dataset.refused || 0);
const before = refused();
const key = (type) => document.body.dispatchEvent(new KeyboardEvent(type, { key: "r", code: "KeyR",
  bubbles: true, cancelable: true }));
const press = () => {
  if (pad.disabled) { requestAnimationFrame(press); return; }
  key("keydown");
  setTimeout(() => { key("keyup"); done(refused() - before); }, 300);
};
const take = () => {
  if (!wheel.hasAttribute("data-settled")) { requestAnimationFrame(take); return; }
  wheel.click();
  press();
};
take();"""


@unittest.skipUnless(WITH_BROWSER, 'there is no chromedriver')
class Teleoperation(ConsolePage, unittest.TestCase):
    whole_browser = True
    forward = -1.0  # how the pad was pushed last

    @classmethod
    def setUpClass(cls):
        cls.arm, cls.lag = FakeArm(), MachineLag()
        cls.audited, cls.states, cls.commands = [], [], []
        rospy.Subscriber('/expert_console/audit', ConsoleCommand, cls.audited.append)
        rospy.Subscriber(
            '/manipulation_interface/state', TeleopState, cls.states.append, tcp_nodelay=True
        )
        rospy.Subscriber(
            '/manipulation_interface/command', TeleopCommand, cls.heard, tcp_nodelay=True
        )
        cls.begin('console_teleoperation_robot.py', size=(1360, 1000))

    @classmethod
    def heard(cls, command):
        cls.commands.append((time.monotonic(), command))

    def height(self):
        self.assertTrue(wait_for(lambda: self.states), 'the interface publishes its state')
        return self.states[-1].tool_pose.position.z

    def moves(self):
        begun_s = time.monotonic()
        return wait_for(lambda: self.arm.moved_s > begun_s + 0.2)

    def late_s(self, let_go):
        """How long it still moves, and what a busy machine may add to that: three processes have a
        part in it.
        """
        asked_s = time.monotonic()
        return self.arm.stands_after(let_go), 3 * self.lag.most_s(asked_s - 0.1)

    def assert_stops(self, move, let_go, afterwards=lambda: None):
        def measure():
            move()
            late_s = self.late_s(let_go)
            afterwards()
            return late_s

        assert_soon(measure, STOPS_WITHIN_S)

    def assert_moves_nothing(self, what):
        moved_s = self.arm.moved_s
        what()
        self.assertTrue(stays(lambda: self.arm.moved_s == moved_s, 0.5))

    def key(self, down):
        if down:
            self.browser.hold('r')
        else:
            ActionChains(self.browser.driver, duration=0).key_up('r').perform()

    def hold_key(self):
        self.key(True)
        self.assertTrue(self.moves())

    def told(self, name):
        return [told for told in self.audited if told.command == name]

    def test_1_the_wheel_of_an_interface_that_is_started_on_demand(self):
        browser = self.browser
        browser.click(QUESTION)
        browser.click('.choice.interface[data-name=manipulation]')
        refused = browser.run('return Number(document.body.dataset.refused || 0)')
        self.assertEqual(
            self.press_at_once('[data-action=stop-hand]'), refused, 'nothing delays it'
        )
        self.assertTrue(wait_for(lambda: [told.ok for told in self.told('stop_hand')] == [True]))
        browser.find('.manipulation', 40.0)
        self.assertTrue(
            browser.says('was started for this question', '.output'), 'its output is there'
        )
        self.assertFalse(browser.find('.pad[data-move=up]').is_enabled(), 'nobody drives yet')
        self.assert_accessible('a hand that somebody may drive')
        browser.click('.wheel')
        self.assertTrue(browser.says('You drive.', '.driver'))
        browser.click('[data-frame=base]')
        self.assert_accessible('a hand that is driven')
        self.assert_wide_at(1024, '.drive-facts dd', 200)

    def test_2_a_held_key_moves_the_hand_and_one_that_is_let_go_stops_it(self):
        before = self.height()
        self.hold_key()
        self.assertTrue(self.browser.says('Moves freely', '.drive-light'))
        times = [at for at, command in self.commands if command.dead_man][-30:]
        self.key(False)
        self.assert_stops(self.hold_key, lambda: self.key(False))
        self.assertGreater(self.height(), before + 0.01, 'upwards')
        self.assertFalse(self.commands[-1][1].dead_man, 'the page has said so')
        gaps = sorted(after - before for before, after in zip(times, times[1:]))
        # a quarter of them: the others may have waited for a loaded machine
        self.assertLess(gaps[len(gaps) // 4], 1 / 30.0, '30 commands a second or more')

    def test_2_a_button_held_with_the_mouse_stops_when_the_page_loses_the_focus(self):
        before = self.height()
        pad = self.settled_pad('down')

        def press():
            ActionChains(self.browser.driver, duration=0).click_and_hold(pad).perform()
            self.assertTrue(self.moves())

        def release():
            ActionChains(self.browser.driver, duration=0).release().perform()

        self.assert_stops(
            press, lambda: self.browser.run('window.dispatchEvent(new Event("blur"))'), release
        )
        self.assertLess(self.height(), before)
        self.assert_stops(
            press,
            lambda: self.browser.run(
                'Object.defineProperty(document, "hidden", {value: true, configurable: true});'
                'document.dispatchEvent(new Event("visibilitychange")); delete document.hidden'
            ),
            release,
        )

    def settled_pad(self, move):
        """A button that the page takes as pressed on purpose: it has not just moved."""
        pad = self.browser.find('.pad[data-move={}]'.format(move))
        self.assertTrue(wait_for(lambda: self.browser.settled(pad)))
        return pad

    def test_2_a_button_takes_enter_and_space_and_stops_with_either_or_without_the_focus(self):
        browser = self.browser
        chain = partial(ActionChains, browser.driver, duration=0)

        def press(key, move):
            browser.run('arguments[0].focus()', self.settled_pad(move))
            chain().key_down(key).perform()
            self.assertTrue(self.moves())

        before = self.height()
        self.assert_stops(partial(press, ' ', 'up'), lambda: chain().key_up(' ').perform())
        self.assertGreater(self.height(), before)
        self.assert_stops(
            partial(press, Keys.ENTER, 'down'), lambda: chain().key_up(Keys.ENTER).perform()
        )
        other = 'document.querySelector("[data-frame=base]").focus()'
        self.assert_stops(
            partial(press, ' ', 'down'),
            partial(browser.run, other),
            lambda: chain().key_up(' ').perform(),
        )
        self.assertTrue(self.browser.says('You drive.', '.driver'), 'nothing else was pressed')
        self.assert_moves_nothing(lambda: browser.run(HELD_AT_ONCE))
        self.assertGreater(int(browser.run('return document.body.dataset.refused || 0')), 0)

    def test_2_a_letter_moves_nothing_where_the_wheel_has_only_just_been_taken(self):
        browser = self.browser
        browser.click('.wheel')
        self.assertTrue(browser.says('Take the wheel', '.wheel'))
        browser.driver.set_script_timeout(60)
        refused = []
        self.assert_moves_nothing(
            lambda: refused.append(browser.driver.execute_async_script(KEY_AT_ONCE))
        )
        self.assertEqual(refused, [1])
        browser.click('#keys')
        self.assert_moves_nothing(lambda: self.key(True))  # letters are turned off
        self.key(False)
        browser.click('#keys')
        self.hold_key()
        self.key(False)

    def test_2_whoever_presses_stop_stops_it_though_the_key_is_held_on(self):
        press = 'document.querySelector("[data-action=stop-hand]").click()'
        self.assertTrue(self.browser.says('no emergency stop', '.manipulation'))

        def take_it_again():
            self.assert_moves_nothing(lambda: None)
            self.key(False)
            self.browser.click('.wheel')
            self.assertTrue(self.browser.says('You drive.', '.driver'))

        self.assert_stops(self.hold_key, partial(self.browser.run, press), take_it_again)
        self.assertTrue(self.told('stop_hand')[-1].ok)

    def finger(self, pad=None):
        """Put it on a button of the page, or lift it."""
        box = self.browser.run('return arguments[0].getBoundingClientRect()', pad) if pad else None
        at = [{'x': box['x'] + box['width'] / 2, 'y': box['y'] + box['height'] / 2}] if pad else []
        self.browser.driver.execute_cdp_cmd(
            'Input.dispatchTouchEvent',
            {'type': 'touchStart' if pad else 'touchEnd', 'touchPoints': at},
        )

    def test_3_a_finger_moves_the_hand_as_long_as_it_rests_on_a_button(self):
        asks = (
            'return arguments[0].dispatchEvent('
            'new MouseEvent("contextmenu", {bubbles: true, cancelable: true}))'
        )
        pad = self.settled_pad('up')

        def touch():
            self.finger(pad)
            self.assertTrue(self.moves())

        touch()
        self.assertFalse(self.browser.run(asks, pad), 'no menu, which a phone would show by now')
        self.assertTrue(self.moves(), 'still')
        self.finger()
        self.assert_stops(touch, self.finger)
        self.assert_stops(
            touch,
            partial(self.browser.run, asks, self.browser.find('.manipulation-head')),
            self.finger,
        )

    def pad(self, held=True, forward=1.0, **more):
        """Put a fake gamepad where the page looks for one; returns when it has looked."""
        self.browser.run(
            'const [held, forward, more] = arguments;'
            'const buttons = Array.from({ length: 17 }, () => ({ pressed: false, value: 0 }));'
            'buttons[4] = { pressed: held, value: Number(held) };'
            'const pad = { id: "fake", connected: true, mapping: "standard", axes: [0, -forward, '
            '0, 0], buttons };'
            'Object.assign(pad, more); window.looks = 0;'
            'navigator.getGamepads = () => { window.looks += 1; return [null, pad]; };',
            held,
            forward,
            more,
        )
        self.assertTrue(wait_for(lambda: self.browser.run('return window.looks') > 1))

    def pushed(self):
        """How fast forward (m/s) the hand is told to go, None while the dead-man is not held."""
        newest = self.commands[-1][1]
        return newest.twist.linear.x if newest.dead_man else None

    def test_4_a_gamepad_moves_the_hand_while_its_shoulder_button_is_held(self):
        self.assert_moves_nothing(lambda: self.pad(mapping=''))  # its axes might be any
        self.assertTrue(
            self.browser.says('fake has a layout that this browser does not know', '.hint')
        )
        self.assert_moves_nothing(lambda: self.pad(held=False))  # a stick alone moves nothing
        self.assertTrue(self.browser.says('fake moves while a shoulder button is held', '.hint'))
        self.push_the_pad()
        fast = wait_for(self.pushed)
        self.pad(forward=0.5)
        self.assertTrue(
            wait_for(lambda: self.pushed() and abs(self.pushed() - fast / 2) < 1e-6), 'half as fast'
        )
        self.pad(forward=0.1)
        self.assertTrue(
            wait_for(lambda: self.pushed() == 0.0), 'a stick at rest is never quite in the middle'
        )
        self.assert_stops(self.push_the_pad, lambda: self.pad(held=False))
        for lost in (
            'navigator.getGamepads()[1].connected = false',
            'navigator.getGamepads = () => []',
            'window.dispatchEvent(new Event("blur"))',
        ):
            self.assert_stops(self.push_the_pad, partial(self.browser.run, lost))
            # held all along: to move again it must be let go first
            self.assert_moves_nothing(self.pad)
        self.browser.run('navigator.getGamepads = () => []')

    def push_the_pad(self):
        """To and fro in turn."""
        type(self).forward = -self.forward
        self.pad(held=False)
        self.pad(forward=self.forward)
        self.assertTrue(self.moves(), (self.states[-1], self.browser.text('.manipulation')))

    def seen(self):
        return self.browser.run(
            'return [...document.querySelectorAll(".drive-stage .view")].map((view) => '
            'view.dataset.topic)'
        )

    def look(self, topic):
        self.browser.click('[data-view="{}"]'.format(topic))

    def test_4_the_cameras_stand_side_by_side_with_the_robot_in_3d(self):
        browser, over = self.browser, threading.Event()
        own, foreign = ['/alpha/left', '/alpha/right'], '/beta/camera'
        publishers = [rospy.Publisher(each, Image, queue_size=1) for each in [*own, foreign]]
        noise = np.random.RandomState(1).randint(0, 255, (480, 640, 3)).astype(np.uint8)

        def stream():
            while not over.wait(0.1):
                for each in publishers:
                    each.publish(colour_image(noise, Header(stamp=rospy.Time.now())))

        streaming = threading.Thread(target=stream)
        streaming.start()
        self.addCleanup(streaming.join)
        self.addCleanup(over.set)
        self.assertTrue(wait_for(lambda: self.seen() == own[:1], 40.0), 'its first camera')
        self.look(own[1])
        self.look('/robot_description')
        self.assertEqual(self.seen(), [*own, '/robot_description'])
        self.assertTrue(wait_for(lambda: self.widths() == [640, 640]))
        self.assert_accessible('cameras and a robot beside the controls')
        tops = browser.run(
            'return [...document.querySelectorAll(".drive-stage .view")].slice(0, 2).map((view) => '
            'view.getBoundingClientRect().top)'
        )
        self.assertEqual(tops[0], tops[1], 'side by side')
        browser.run(
            'const more = document.querySelector(".drive-views select"); more.value = arguments[0];'
            'more.dispatchEvent(new Event("change"))',
            foreign,
        )
        self.assertTrue(browser.says('Not known as a camera of this robot: ' + foreign))
        self.assertEqual(self.seen(), [own[1], '/robot_description', foreign], 'three at most')
        self.look(own[1])
        self.look('/robot_description')
        self.assertEqual(self.seen(), [foreign])
        self.look(own[0])
        self.assertNotIn(foreign, browser.run('return localStorage.getItem("drive views")'))
        self.link(100_000)
        self.addCleanup(self.link, -1)
        self.assertTrue(wait_for(lambda: max(self.widths()) < 640, 40.0), 'narrower')
        self.assertTrue(browser.says('px (slow link)', '.drive-stage'))
        self.link(-1)
        self.assertTrue(wait_for(lambda: min(self.widths()) == 640, 40.0), 'wide again')

    def widths(self):
        """Pixels across of the images that are shown."""
        return self.browser.run(
            'return [...document.querySelectorAll(".drive-stage canvas.image")].map((canvas) => '
            'canvas.width)'
        )

    def link(self, bytes_per_s):
        """Make the browser's link that slow; -1: as it is."""
        self.browser.driver.set_network_conditions(
            latency=0, download_throughput=bytes_per_s, upload_throughput=-1
        )

    def drive_by_key(self):
        # the page had given the link up meanwhile
        if not self.browser.says('You drive.', '.driver', 5.0):
            self.browser.click('.wheel')
            self.assertTrue(self.browser.says('You drive.', '.driver', 30.0))
        self.hold_key()

    def test_5_a_link_that_is_lost_stops_the_hand_and_what_was_held_back_does_not_move_it(self):
        self.addCleanup(self.console.thaw)

        def freeze():
            self.console.freeze()
            frozen.append(rospy.Time.now())

        def go_on():
            self.key(False)
            time.sleep(0.2)  # so long have the youngest of those that are held back waited
            relayed = len(self.commands)
            self.console.thaw()
            self.assertTrue(
                wait_for(lambda: len(self.commands) > relayed), 'the late ones have come'
            )
            self.assert_moves_nothing(lambda: None)
            held = [
                command.header.stamp for _, command in self.commands[relayed:] if command.dead_man
            ]
            self.assertEqual(
                [stamp for stamp in held if stamp > frozen[-1]], [], 'none that moves it'
            )
            # those had been relayed before, and were on their way out
            self.assertLessEqual(len(held), QUEUED)

        frozen = []
        self.assert_stops(self.drive_by_key, freeze, go_on)

    def test_6_a_browser_that_is_killed_at_the_wheel_stops_and_leaves_it_to_others(self):
        killed = []

        def gone():
            return [told for told in self.told('leave_wheel') if told.message == 'the page is gone']

        def kill():
            killed.append(len(gone()))
            self.browser.kill()

        def another_browser():
            self.assertTrue(wait_for(lambda: len(gone()) > killed[-1]))
            self.browser.close()
            type(self).browser = Browser(1360, 1000)
            self.browser.driver.get(self.page)
            self.remember_name(self.browser, 'operator')
            self.browser.click(QUESTION)
            self.browser.click('.wheel', 40.0)
            self.assertTrue(self.browser.says('You drive.', '.driver', 30.0))

        self.assert_stops(self.drive_by_key, kill, another_browser)

    def test_7_the_gripper_and_the_end(self):
        browser = self.browser
        browser.hold('c')
        self.assertTrue(wait_for(lambda: self.states[-1].gripper_stalled), 'it has met something')
        ActionChains(browser.driver, duration=0).key_up('c').perform()
        self.assertTrue(browser.says('holds something', '.drive-facts'))
        browser.click('.finish')
        self.assertTrue(browser.says('PICK counts as having ended with succeeded.', '.follow-up'))
        self.assertTrue(
            wait_for(lambda: rospy.get_param('/alpha/placed', '') == 'base_footprint'),
            'the grasp is told',
        )
        self.assertTrue(wait_for(lambda: self.told('leave_wheel')))
        self.assertEqual(
            {told.ok for told in self.told('take_wheel') + self.told('hand_over')}, {True}
        )
        self.assertIn('relayed', self.told('leave_wheel')[-1].arguments)
        self.assertTrue(self.told('take_wheel')[0].query_id)
        self.assertEqual(self.told('drive'), [], 'sessions are audited, not every command')
        self.assertEqual(browser.errors(), [])


if __name__ == '__main__':
    rospy.init_node('console_teleoperation')
    rostest.rosrun('smach_oracle', 'console_teleoperation', Teleoperation)
