#!/usr/bin/env python3
"""ActionServerWrapper as its action clients see it."""

import threading
import unittest

import actionlib
import rospy
import rostest
from actionlib.msg import TestAction, TestFeedback, TestGoal, TestResult
from actionlib_msgs.msg import GoalStatus
from smach_ros_support import LogWatch, improvement
from waiting import wait_for

import smach
from smach_ros import ActionServerWrapper

KEYS = [
    'action_goal',
    'action_feedback',
    'action_result',
    'goal',
    'result',
    'order',
    'answer',
    'progress',
]
OUTCOMES = ['good', 'bad', 'stopped', 'odd']


class Work(smach.State):
    """Does what the test says with all keys at hand."""

    def __init__(self, work):
        smach.State.__init__(self, outcomes=OUTCOMES + ['next'], io_keys=KEYS)
        self.work = work

    def execute(self, ud):
        return self.work(self, ud)


def until_preempted(state, ud):
    if wait_for(state.preempt_requested):
        state.service_preempt()
        return 'stopped'
    return 'good'


class WrapperTest(unittest.TestCase):
    def serve(self, *works, **arguments):
        machine = smach.StateMachine(outcomes=OUTCOMES, input_keys=KEYS, output_keys=KEYS)
        with machine:
            for i, work in enumerate(works):
                follower = 'S%d' % (i + 1) if i + 1 < len(works) else 'good'
                smach.StateMachine.add('S%d' % i, Work(work), {'next': follower})
        self.name = self._testMethodName[5:]
        self.wrapper = ActionServerWrapper(
            self.name, TestAction, machine, ['good'], ['bad'], ['stopped'], **arguments
        )
        self.wrapper.run_server()
        self.client = actionlib.SimpleActionClient(self.name, TestAction)
        self.assertTrue(self.client.wait_for_server(rospy.Duration(30)))
        return machine

    def begin(self, number):
        """Send a goal, and wait until it is worked on."""
        self.ask(number, wait_s=0)
        self.assertTrue(wait_for(lambda: self.client.get_state() == GoalStatus.ACTIVE))

    def ask(self, number, wait_s=30.0):
        self.feedback = []
        self.client.send_goal(
            TestGoal(number), feedback_cb=lambda message: self.feedback.append(message.feedback)
        )
        self.assertTrue(not wait_s or self.client.wait_for_result(rospy.Duration(wait_s)))
        return self.client.get_state()

    def test_goal_feedback_and_result_are_messages_in_userdata(self):
        def start(state, ud):
            ud.action_feedback = TestFeedback(1)
            return 'next'

        def end(state, ud):
            ud.action_result = TestResult(ud.action_goal.goal + 1)
            return 'good'

        self.serve(start, end)
        for number in (5, 6):
            self.assertEqual(self.ask(number), GoalStatus.SUCCEEDED)
            self.assertEqual(self.client.get_result().result, number + 1)
            self.assertEqual(self.feedback, [1])

    @improvement
    def test_slot_maps_rename_single_fields(self):
        def start(state, ud):
            ud.progress = 30
            return 'next'

        def end(state, ud):
            ud.answer = ud.order * 2
            return 'good'

        self.serve(
            start,
            end,
            goal_slots_map={'goal': 'order'},
            feedback_slots_map={'feedback': 'progress'},
            result_slots_map={'result': 'answer'},
        )
        self.assertEqual(self.ask(21), GoalStatus.SUCCEEDED)
        self.assertEqual((self.client.get_result().result, self.feedback), (42, [30]))

    def test_fields_go_by_their_own_names(self):
        def work(state, ud):
            ud.result = ud.goal * 3
            return 'good'

        self.serve(work, expand_goal_slots=True, pack_result_slots=True)
        self.assertEqual(self.ask(7), GoalStatus.SUCCEEDED)
        self.assertEqual(self.client.get_result().result, 21)

    @improvement
    def test_outcome_lists_decide_how_the_goal_ends(self):
        self.serve(lambda state, ud: OUTCOMES[ud.action_goal.goal])
        with LogWatch() as log:
            ends = [self.ask(i) for i in range(4)]
        self.assertEqual(
            ends,
            [GoalStatus.SUCCEEDED, GoalStatus.ABORTED, GoalStatus.PREEMPTED, GoalStatus.ABORTED],
        )
        self.assertIn("outcome 'odd'", log.text())

    @improvement
    def test_exception_aborts_with_its_text_and_the_server_goes_on(self):
        self.serve(lambda state, ud: 'good' if 1 / ud.action_goal.goal else 'bad')
        self.assertEqual(self.ask(0), GoalStatus.ABORTED)
        self.assertIn('division by zero', self.client.get_goal_status_text())
        self.assertEqual(self.ask(1), GoalStatus.SUCCEEDED)

    @improvement
    def test_missing_result_key_aborts_and_says_which(self):
        self.serve(lambda state, ud: 'good', result_slots_map={'result': 'answer'})
        self.assertEqual(self.ask(1), GoalStatus.ABORTED)
        self.assertIn('answer', self.client.get_goal_status_text())

    def test_cancel_preempts_the_container_each_time(self):
        self.serve(until_preempted)
        for _ in range(3):
            self.begin(1)
            self.client.cancel_goal()
            self.assertTrue(self.client.wait_for_result(rospy.Duration(30)))
            self.assertEqual(self.client.get_state(), GoalStatus.PREEMPTED)

    def test_newer_goal_preempts_the_one_under_way(self):
        self.serve(
            lambda state, ud: until_preempted(state, ud) if ud.action_goal.goal == 1 else 'good'
        )
        self.begin(1)
        other = actionlib.SimpleActionClient(self.name, TestAction)
        self.assertTrue(other.wait_for_server(rospy.Duration(30)))
        other.send_goal(TestGoal(2))
        self.assertTrue(other.wait_for_result(rospy.Duration(30)))
        self.assertEqual(other.get_state(), GoalStatus.SUCCEEDED)
        self.assertEqual(self.client.get_state(), GoalStatus.PREEMPTED)

    @improvement
    def test_cancel_that_came_too_late_does_not_stop_the_next_goal(self):
        release = threading.Event()

        def stubborn(state, ud):
            release.wait(60)
            return 'good'

        def check(state, ud):
            return 'stopped' if state.preempt_requested() else 'good'

        machine = self.serve(
            lambda state, ud: (stubborn if ud.action_goal.goal == 1 else check)(state, ud)
        )
        self.begin(1)
        self.client.cancel_goal()
        self.assertTrue(wait_for(machine['S0'].preempt_requested))
        release.set()
        self.assertTrue(self.client.wait_for_result(rospy.Duration(30)))
        self.assertEqual(self.client.get_state(), GoalStatus.SUCCEEDED)
        self.assertEqual(self.ask(2), GoalStatus.SUCCEEDED)

    @improvement
    def test_mistakes_are_logged_when_the_wrapper_is_made(self):
        machine = smach.StateMachine(outcomes=['good'])
        with LogWatch() as log:
            ActionServerWrapper(
                'mistaken', TestAction, machine, ['good'], ['good'], goal_slots_map={'gaol': 'x'}
            )
        self.assertIn('more than one', log.text())
        self.assertIn('gaol', log.text())


if __name__ == '__main__':
    rospy.init_node('smach_ros_wrapper')
    rostest.rosrun('smach_oracle', 'smach_ros_wrapper', WrapperTest)
