#!/usr/bin/env python3
"""SimpleActionState against servers that die, freeze, vanish or ignore what they are told."""

import time
import unittest

import rospy
import rostest
from actionlib.msg import TestAction, TestGoal
from actionlib_msgs.msg import GoalStatus
from smach_ros_action_node import Behaviour
from smach_ros_support import ActionNodeProcess, InBackground, LogWatch, TellingState, userdata
from waiting import wait_for

import smach
from smach_ros import goal_run, server_watch
from smach_ros.action_link import link_to


class ActionFaultsTest(unittest.TestCase):
    """Each test has a server of its own, to be killed at will."""

    def setUp(self):
        self.name = self._testMethodName[5:25]
        self.server = ActionNodeProcess(self.name)
        self.addCleanup(self.server.stop)

    def state(self, number, **arguments):
        return TellingState(self.name, TestAction, goal=TestGoal(number), **arguments)

    def start_server(self):
        """Start it, and wait until a goal can be sent: a process takes its time to come up on a
        busy machine.
        """
        self.server.start()
        self.assertTrue(wait_for(link_to(self.name, TestAction).ready))

    def with_limit(self, module, name, value):
        self.addCleanup(setattr, module, name, getattr(module, name))
        setattr(module, name, value)

    def test_killed_server_is_noticed_and_its_successor_is_used(self):
        self.start_server()
        results = []
        state = self.state(
            Behaviour.DIE, result_cb=lambda ud, status, result: results.append((status, result))
        )
        with LogWatch() as log:
            run = InBackground(state, userdata())
            self.server.process.wait(30)
            died_s = time.monotonic()
            self.assertEqual(run.outcome(), 'aborted')
        self.assertLess(time.monotonic() - died_s, 8.0)
        self.assertIn('nobody answers', log.text())
        self.assertIn(self.name, log.text())
        self.assertEqual(results, [(GoalStatus.LOST, None)])
        impatient = self.state(150, server_wait_timeout=rospy.Duration(0.3))
        self.assertEqual(impatient.execute(userdata()), 'aborted')
        waiting = InBackground(self.state(150), userdata())
        self.server.start()
        self.assertEqual(waiting.outcome(), 'succeeded')

    def test_machine_takes_the_aborted_transition_when_a_server_is_killed(self):
        self.server.start()
        machine = smach.StateMachine(outcomes=['done', 'recovered', 'preempted'])
        with machine:
            smach.StateMachine.add(
                'WORK', self.state(Behaviour.DIE), {'succeeded': 'done', 'aborted': 'RECOVER'}
            )
            smach.StateMachine.add(
                'RECOVER', smach.CBState(lambda ud: 'recovered', outcomes=['recovered'])
            )
        self.assertEqual(InBackground(machine).outcome(), 'recovered')

    def test_frozen_server_is_given_up_after_its_time(self):
        self.start_server()
        state = self.state(Behaviour.FREEZE)
        state.server_frozen_timeout_s = 4.0
        with LogWatch() as log:
            run = InBackground(state, userdata())
            self.assertEqual(run.outcome(), 'aborted')
        self.assertIn('no sign of life', log.text())
        self.assertGreater(run.took_s(), 4.0)

    def test_withdrawn_action_of_a_living_node_is_noticed(self):
        self.with_limit(server_watch, 'WITHDRAWN_AFTER_S', 1.0)
        self.server.start()
        with LogWatch() as log:
            self.assertEqual(
                InBackground(self.state(Behaviour.CLOSE), userdata()).outcome(), 'aborted'
            )
        self.assertIn('no longer serves the action', log.text())

    def test_goal_the_server_never_acknowledges_is_given_up(self):
        self.with_limit(goal_run, 'UNSEEN_AFTER_S', 1.0)
        self.server.start()
        with LogWatch() as log:
            self.assertEqual(
                InBackground(self.state(Behaviour.UNSEEN), userdata()).outcome(), 'aborted'
            )
        self.assertIn('no notice', log.text())
        self.assertEqual(self.state(150).execute(userdata()), 'succeeded')

    def test_preempt_timeout_ends_the_wait_for_a_server_that_ignores_a_cancel(self):
        self.server.start()
        state = self.state(Behaviour.IGNORE_CANCEL, preempt_timeout=rospy.Duration(0.5))
        for _ in range(2):
            with LogWatch() as log:
                state.active.clear()
                run = InBackground(state, userdata())
                self.assertTrue(state.active.wait(30))
                state.request_preempt()
                self.assertEqual(run.outcome(), 'preempted')
            self.assertIn('0.5 s after the cancel', log.text())
        self.assertEqual(self.state(150).execute(userdata()), 'succeeded')

    def test_both_timeouts_apply_to_a_server_that_never_answers(self):
        self.start_server()
        state = self.state(
            Behaviour.IGNORE_CANCEL,
            exec_timeout=rospy.Duration(0.5),
            preempt_timeout=rospy.Duration(0.5),
        )
        run = InBackground(state, userdata())
        self.assertEqual(run.outcome(), 'aborted')
        self.assertGreater(run.took_s(), 1.0)
        self.assertLess(run.took_s(), 8.0)

    def test_silent_waiting_goal_is_preempted_when_its_server_is_dead(self):
        self.server.start()
        state = self.state(Behaviour.HANG)
        run = InBackground(state, userdata())
        self.assertTrue(state.active.wait(30))
        self.server.process.kill()
        state.request_preempt()
        # not after the 60 s that a server has for a cancel
        self.assertEqual(run.outcome(20.0), 'preempted')


if __name__ == '__main__':
    rospy.init_node('smach_ros_action_faults')
    rostest.rosrun('smach_oracle', 'smach_ros_action_faults', ActionFaultsTest)
