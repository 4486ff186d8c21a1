#!/usr/bin/env python3
"""ServiceState, MonitorState and ConditionState against real services and topics; the Ctrl-C
handler.
"""

import os
import subprocess
import sys
import threading
import time
import unittest

import rosgraph
import rospy
import rostest
from smach_ros_support import HERE, InBackground, LogWatch, improvement, userdata
from std_msgs.msg import Int32
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse
from waiting import wait_for

import smach
from smach_oracle.experiment.launching import free_port
from smach_ros import ConditionState, MonitorState, ServiceState


def set_bool(request):
    if not request.data:
        raise rospy.ServiceException('will not')
    return SetBoolResponse(True, 'done')


class ServiceStateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.called, cls.release = threading.Event(), threading.Event()
        rospy.Service('switch', SetBool, set_bool)
        rospy.Service('slow', SetBool, cls.answer_late)

    @classmethod
    def answer_late(cls, request):
        cls.called.set()
        cls.release.wait(60)
        return SetBoolResponse(True, 'late')

    def test_answer_goes_to_userdata(self):
        data = userdata(data=True)
        state = ServiceState(
            'switch',
            SetBool,
            request_slots=['data'],
            response_key='whole',
            response_slots=['message'],
        )
        self.assertEqual(state.execute(data), 'succeeded')
        self.assertEqual((data.message, data.whole.success), ('done', True))

    @improvement
    def test_request_from_key_and_callbacks_with_their_interfaces(self):
        @smach.cb_interface(input_keys=['wish'])
        def ask(ud, request, negate):
            request.data = ud.wish != negate

        @smach.cb_interface(output_keys=['said'], outcomes=['well'])
        def hear(ud, response):
            ud.said = response.message
            return 'well'

        data = userdata(wish=True, whole=SetBoolRequest(False))
        state = ServiceState(
            'switch',
            SetBool,
            request_key='whole',
            request_cb=ask,
            request_cb_args=[False],
            response_cb=hear,
        )
        self.assertEqual(state.execute(data), 'well')
        self.assertEqual(data.said, 'done')
        self.assertFalse(data.whole.data)

    def test_the_answer_itself_stands_where_the_callback_wrote_to_the_same_key(self):
        def hear(ud, response):
            self.assertNotIn('message', ud)
            ud.message = 'from the callback'

        data = userdata()
        state = ServiceState(
            'switch',
            SetBool,
            SetBoolRequest(True),
            response_cb=hear,
            response_slots=['message'],
            output_keys=['message'],
        )
        self.assertEqual(state.execute(data), 'succeeded')
        self.assertEqual(data.message, 'done')

    @improvement
    def test_a_service_that_has_gone_since_the_last_call_aborts(self):
        service = rospy.Service('brief', SetBool, set_bool)
        state = ServiceState('brief', SetBool, SetBoolRequest(True))
        self.assertEqual(state.execute(userdata()), 'succeeded')
        service.shutdown()
        with LogWatch() as log:
            self.assertEqual(InBackground(state, userdata()).outcome(), 'aborted')
        self.assertIn('brief', log.text())
        service = rospy.Service('brief', SetBool, set_bool)
        self.addCleanup(service.shutdown)
        self.assertEqual(state.execute(userdata()), 'succeeded')

    @improvement
    def test_what_goes_wrong_aborts_and_is_logged(self):
        request = SetBoolRequest(True)
        for state, words in (
            (ServiceState('switch', SetBool, SetBoolRequest(False)), 'will not'),
            (ServiceState('switch', SetBool, request, request_cb=lambda *_: 1 / 0), 'ZeroDivision'),
            (
                ServiceState('switch', SetBool, request, response_cb=lambda *_: 1 / 0),
                'ZeroDivision',
            ),
            (ServiceState('switch', SetBool, request, response_cb=lambda *_: 'odd'), "'odd'"),
            (ServiceState('switch', SetBool, request_slots=['data']), 'data'),
        ):
            with LogWatch() as log:
                self.assertEqual(state.execute(userdata()), 'aborted')
            self.assertIn(words, log.text())

    @improvement
    def test_absent_service_is_awaited_and_a_preempt_ends_the_wait(self):
        state = ServiceState('later', SetBool, SetBoolRequest(True))
        run = InBackground(state, userdata())
        self.assertTrue(run.waits())
        state.request_preempt()
        self.assertEqual(run.outcome(), 'preempted')
        run = InBackground(state, userdata())
        service = rospy.Service('later', SetBool, set_bool)
        self.assertEqual(run.outcome(), 'succeeded')
        service.shutdown()

    @improvement
    def test_service_that_does_not_answer_cannot_hold_a_preempt_for_ever(self):
        state = ServiceState('slow', SetBool, SetBoolRequest(True), preempt_timeout=0.5)
        run = InBackground(state, userdata())
        self.assertTrue(self.called.wait(30))
        state.request_preempt()
        self.assertEqual(run.outcome(), 'preempted')
        self.release.set()

    @improvement
    def test_call_that_ends_soon_after_a_preempt_counts(self):
        called, preempted = threading.Event(), threading.Event()

        def until_preempted(request):
            called.set()
            preempted.wait(30)
            return SetBoolResponse(True, 'kept')

        rospy.Service('until_preempted', SetBool, until_preempted)
        data = userdata()
        state = ServiceState(
            'until_preempted',
            SetBool,
            SetBoolRequest(True),
            response_slots=['message'],
            preempt_timeout=30.0,
        )
        run = InBackground(state, data)
        self.assertTrue(called.wait(30))
        state.request_preempt()
        self.assertEqual(run.outcome(0.1), 'still running', 'it waits for the answer')
        preempted.set()
        self.assertEqual(run.outcome(), 'succeeded')
        self.assertEqual(data.message, 'kept')
        self.assertTrue(state.preempt_requested())


class MonitorStateTest(unittest.TestCase):
    def setUp(self):
        self.topic = self.id().split('.')[-1]
        self.publisher = rospy.Publisher(self.topic, Int32, queue_size=20)
        self.addCleanup(self.publisher.unregister)

    def watch(self, state, data, values):
        run = InBackground(state, data)
        self.assertTrue(wait_for(self.publisher.get_num_connections))
        for value in values:
            self.publisher.publish(value)
        return run

    @improvement
    def test_first_false_message_is_invalid(self):
        seen = []
        state = MonitorState(
            self.topic, Int32, lambda ud, message: seen.append(message.data) or message.data > 0
        )
        for _ in range(2):
            del seen[:]
            self.assertEqual(self.watch(state, userdata(), [1, 2, 0, 3]).outcome(), 'invalid')
            self.assertEqual(seen, [1, 2, 0])
            self.assertTrue(wait_for(lambda: not self.publisher.get_num_connections()))

    def test_enough_true_messages_are_valid(self):
        state = MonitorState(self.topic, Int32, lambda ud, message: message.data > 0, max_checks=2)
        self.assertEqual(self.watch(state, userdata(), [1, 2, 0]).outcome(), 'valid')

    def test_callback_reads_and_writes_userdata(self):
        def keep(ud, message):
            ud.last = message.data + ud.offset

        state = MonitorState(self.topic, Int32, keep, input_keys=['offset'], output_keys=['last'])
        data = userdata(offset=10)
        self.assertEqual(self.watch(state, data, [5]).outcome(), 'invalid')
        self.assertEqual(data.last, 15)

    @improvement
    def test_callback_that_raises_is_invalid_and_logged(self):
        state = MonitorState(self.topic, Int32, lambda ud, message: 1 / message.data)
        with LogWatch() as log:
            self.assertEqual(self.watch(state, userdata(), [0]).outcome(), 'invalid')
        self.assertIn('ZeroDivisionError', log.text())

    def test_preempt_is_never_lost(self):
        state = MonitorState(self.topic, Int32, lambda ud, message: True)
        state.request_preempt()
        self.assertEqual(InBackground(state, userdata()).outcome(), 'preempted')
        for _ in range(3):
            run = self.watch(state, userdata(), [1])
            state.request_preempt()
            self.assertEqual(run.outcome(), 'preempted')
            self.assertFalse(state.preempt_requested())

    def test_preempt_does_not_wait_for_a_slow_callback(self):
        busy, release = threading.Event(), threading.Event()

        def ponder(ud, message):
            busy.set()
            return release.wait(60)

        state = MonitorState(self.topic, Int32, ponder)
        run = self.watch(state, userdata(), [1])
        self.assertTrue(busy.wait(30))
        state.request_preempt()
        self.assertEqual(run.outcome(), 'preempted')
        release.set()


class ConditionStateTest(unittest.TestCase):
    def count(self, true_at, **arguments):
        calls = []
        state = ConditionState(
            lambda ud: calls.append(1) or len(calls) == true_at,
            poll_rate=rospy.Duration(0.01),
            **arguments,
        )
        return state.execute(userdata()), len(calls)

    def test_true_at_once_or_within_its_checks(self):
        self.assertEqual(self.count(1), ('true', 1))
        self.assertEqual(self.count(3, max_checks=2), ('true', 3))

    def test_false_after_its_checks_or_its_time(self):
        self.assertEqual(self.count(0), ('false', 2))
        self.assertEqual(self.count(0, max_checks=3), ('false', 4))
        outcome, checks = self.count(0, max_checks=-1, timeout=rospy.Duration(0.3))
        self.assertEqual(outcome, 'false')
        self.assertGreater(checks, 2)

    def test_a_decorated_condition_brings_its_keys(self):
        @smach.cb_interface(input_keys=['level'], output_keys=['seen'])
        def full(ud):
            ud.seen = ud.level
            return ud.level > 3

        machine = smach.StateMachine(['true', 'false', 'preempted'])
        machine.userdata.level = 4
        with machine:
            smach.StateMachine.add('FULL', ConditionState(full))
        self.assertEqual(machine.execute(), 'true')
        self.assertEqual(machine.userdata.seen, 4)

    def test_no_time_at_all_means_no_limit(self):
        self.assertEqual(self.count(5, max_checks=-1, timeout=rospy.Duration(0)), ('true', 5))

    @improvement
    def test_preempt_ends_a_long_pause(self):
        looked = threading.Event()
        state = ConditionState(
            lambda ud: looked.set(), poll_rate=rospy.Duration(60.0), max_checks=-1
        )
        run = InBackground(state, userdata())
        self.assertTrue(looked.wait(30) and run.waits())
        state.request_preempt()
        self.assertEqual(run.outcome(), 'preempted')

    def test_exception_surfaces(self):
        with self.assertRaisesRegex(smach.InvalidUserCodeError, 'ZeroDivisionError'):
            ConditionState(lambda ud: 1 / 0).execute(userdata())


class CtrlCTest(unittest.TestCase):
    def press(self, where, handler):
        script = subprocess.Popen(
            [sys.executable, os.path.join(HERE, 'smach_ros_interrupted_script.py'), where, handler],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        said = b''
        while b'waiting' not in said:
            line = script.stdout.readline()
            self.assertTrue(line, said)
            said += line
        begin = time.monotonic()
        script.send_signal(2)
        rest, _ = script.communicate(timeout=20)
        self.assertLess(time.monotonic() - begin, 6.0)
        return (said + rest).decode()

    @improvement
    def test_handler_preempts_a_machine_in_the_main_thread(self):
        self.assertIn('ended: preempted', self.press('main', 'handler'))

    def test_handler_preempts_a_machine_in_another_thread_before_topics_close(self):
        said = self.press('thread', 'handler')
        self.assertIn('ended: preempted', said)
        self.assertIn('while up: True', said)

    @improvement
    def test_states_of_ours_end_without_a_handler_too(self):
        self.assertIn('ended: preempted', self.press('main', 'none'))

    @improvement
    def test_where_rospy_leaves_signals_alone_the_handler_takes_them(self):
        self.assertIn('ended: preempted', self.press('main', 'unsignalled'))


class NoMasterTest(unittest.TestCase):
    @improvement
    def test_ctrl_c_ends_states_that_began_while_the_master_was_away(self):
        port = free_port()
        master = subprocess.Popen(
            ['rosmaster', '--core', '-p', str(port)], stdout=subprocess.DEVNULL
        )
        self.addCleanup(master.kill)
        uri = 'http://localhost:%d' % port
        self.assertTrue(wait_for(lambda: rosgraph.is_master_online(uri)))
        script = subprocess.Popen(
            [sys.executable, os.path.join(HERE, 'smach_ros_masterless_script.py'), str(master.pid)],
            stdout=subprocess.PIPE,
            env=dict(os.environ, ROS_MASTER_URI=uri),
        )
        self.addCleanup(script.kill)
        self.assertEqual(script.stdout.readline(), b'waiting\n')
        begin = time.monotonic()
        script.send_signal(2)
        said, _ = script.communicate(timeout=20)
        self.assertLess(time.monotonic() - begin, 6.0)
        self.assertIn(b'ended: preempted', said)


def all_tests():
    """Every test case of this file, as one suite."""
    load = unittest.defaultTestLoader.loadTestsFromTestCase
    cases = (ServiceStateTest, MonitorStateTest, ConditionStateTest, CtrlCTest, NoMasterTest)
    return unittest.TestSuite(load(case) for case in cases)


if __name__ == '__main__':
    rospy.init_node('smach_ros_states')
    rostest.rosrun('smach_oracle', 'smach_ros_states', '__main__.all_tests')
