#!/usr/bin/env python3
"""A joystick drives the manipulation interface: held it moves, let go or silent it stands."""

import os
import sys
import time
import unittest

import numpy as np
import rospy
import rostest
from sensor_msgs.msg import Joy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from machine_lag import MachineLag
from teleoperation_fixtures import FakeArm, Person
from waiting import assert_soon, stays, wait_for

STOPS_WITHIN_S = 0.1
SILENCE_S = 0.3  # as launch/joy_teleoperation.yaml has it


class JoyTeleoperation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.arm, cls.lag = FakeArm(), MachineLag()
        cls.ann = Person('manipulation_interface')
        cls.sent = cls.ann.start()
        assert cls.ann.active()
        cls.joy = rospy.Publisher('spacenav/joy', Joy, queue_size=1, tcp_nodelay=True)
        assert wait_for(cls.joy.get_num_connections)

    def push(self, axes, buttons):
        self.joy.publish(Joy(axes=axes, buttons=buttons))

    def push_until_it_moves(self, axes, buttons):
        begun_s = time.monotonic()
        self.push_until(axes, buttons, lambda: self.arm.moved_s >= begun_s + 0.3)
        self.assertGreater(self.arm.moved_s, begun_s + 0.3)

    def push_until(self, axes, buttons, condition):
        """Push again and again, 50 times a second; whether the condition holds in the end."""
        return wait_for(lambda: self.push(axes, buttons) or condition(), 15.0)

    def assert_stops(self, within_s, move, let_go):
        def measure():
            self.push_until_it_moves(*move)
            begun_s = time.monotonic()
            # two processes have a part in it, and this one, each of which a busy machine keeps
            # waiting
            return self.arm.stands_after(let_go, within_s + 0.5), 3 * self.lag.most_s(begun_s - 0.1)

        assert_soon(measure, within_s)

    def let_go(self, *axes):
        self.push(axes or [0] * 6, [0, 0])

    def test_it_moves_while_the_button_is_held_and_stops_when_it_is_let_go(self):
        before = self.ann.tool()
        self.assert_stops(
            STOPS_WITHIN_S, ([0, 0, 1, 0, 0, 0], [1, 0]), lambda: self.let_go(0, 0, 1, 0, 0, 0)
        )
        way = self.ann.tool() - before
        self.assertGreater(way[2], 0.02)
        self.assertLess(abs(way[0]) + abs(way[1]), 0.1 * way[2])
        self.assertEqual(self.ann.states[-1].operator, '')

    def test_a_joystick_that_falls_silent_has_let_go(self):
        self.assert_stops(SILENCE_S + STOPS_WITHIN_S, ([0, 0, -1, 0, 0, 0], [1, 0]), lambda: None)

    def test_each_axis_moves_the_hand_its_own_way(self):
        # from the stretched arm of another test
        self.push_until_it_moves([0, 0, -1, 0, 0, 0], [1, 0])
        self.arm.stands_after(self.let_go)
        for axis in (0, 1, 2):
            before = self.ann.tool()
            tilted = [0.5 if each == axis else 0.04 for each in range(6)]
            self.assert_stops(STOPS_WITHIN_S, (tilted, [1, 0]), self.let_go)
            way = self.ann.tool() - before
            self.assertGreater(way[axis] / np.linalg.norm(way), 0.99, (axis, way))

    def test_without_the_button_nothing_moves(self):
        before_s = self.arm.moved_s
        self.assertTrue(
            stays(
                lambda: self.push([1, 1, 1, 1, 1, 1], [0, 1]) or self.arm.moved_s == before_s, 0.4
            )
        )

    def test_the_second_button_closes_the_gripper_and_opens_it_again(self):
        self.push_until_it_moves([0, 0, 1, 0, 0, 0], [1, 0])
        for stalled in (True, False):
            self.assertTrue(
                self.push_until(
                    [0] * 6,
                    [1, 1],
                    lambda stalled=stalled: self.ann.states[-1].gripper_stalled == stalled,
                )
            )
            self.assertTrue(stays(lambda: self.push([0] * 6, [1, 0]) or True, 0.4), 'let go')
        self.assertGreater(self.ann.states[-1].gripper, 0.08)


if __name__ == '__main__':
    rospy.init_node('joy_teleoperation_test')
    rostest.rosrun('smach_oracle', 'joy_teleoperation', JoyTeleoperation)
