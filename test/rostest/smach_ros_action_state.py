#!/usr/bin/env python3
"""SimpleActionState against real action servers: what a script sees in good times."""

import subprocess
import sys
import threading
import time
import unittest

import rospy
import rostest
from actionlib.msg import TestAction, TestGoal
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from smach_ros_action_node import Behaviour
from smach_ros_support import (
    HERE,
    ActionNodeProcess,
    InBackground,
    LogWatch,
    TellingState,
    improvement,
    userdata,
)
from waiting import wait_for

import smach
import smach_ros
from smach_ros import SimpleActionState


def action_state(number=None, **arguments):
    if number is not None:
        arguments['goal'] = TestGoal(number)
    return TellingState('work', TestAction, **arguments)


class HooksState(SimpleActionState):
    """Overrides the three callbacks, as scripts do; done is not handed on."""

    def __init__(self):
        SimpleActionState.__init__(self, 'work', TestAction, goal=TestGoal(Behaviour.FEEDBACK))
        self.seen = []

    def _goal_active_cb(self):
        self.seen.append('active')

    def _goal_feedback_cb(self, feedback):
        self.seen.append(feedback.feedback)

    def _goal_done_cb(self, status, result):
        self.seen.append((status, result.result))


class SimpleActionStateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = ActionNodeProcess('work').start()
        assert action_state(100).execute(userdata()) == 'succeeded'

    @classmethod
    def tearDownClass(cls):
        cls.server.stop()

    def test_importing_smach_ros_joins_smach_to_rospy(self):
        self.assertIs(smach.loginfo, rospy.loginfo)
        self.assertIs(smach.logerr, rospy.logerr)
        self.assertIs(smach.is_shutdown, rospy.is_shutdown)

    def test_names_that_scripts_import(self):
        for name in (
            'simple_action_state',
            'service_state',
            'monitor_state',
            'condition_state',
            'action_server_wrapper',
            'introspection',
            'util',
        ):
            self.assertTrue(hasattr(smach_ros, name), name)
        self.assertIs(smach_ros.simple_action_state.SimpleActionState, SimpleActionState)

    def test_outcome_follows_the_goal(self):
        for number, outcome in (
            (150, 'succeeded'),
            (Behaviour.ABORT, 'aborted'),
            (Behaviour.REJECT, 'aborted'),
            (Behaviour.FEEDBACK, 'succeeded'),
        ):
            self.assertEqual(action_state(number).execute(userdata()), outcome)

    def test_states_and_executions_leave_no_threads_behind(self):
        states = [action_state(150) for _ in range(20)]
        before = threading.active_count()
        for _ in range(5):
            for state in states:
                self.assertEqual(state.execute(userdata()), 'succeeded')
        self.assertTrue(wait_for(lambda: threading.active_count() <= before), threading.enumerate())

    def test_goal_and_result_go_through_userdata(self):
        data = userdata(goal=200)
        self.assertEqual(
            action_state(goal_slots=['goal'], result_slots=['result']).execute(data), 'succeeded'
        )
        self.assertEqual(data.result, 201)
        data = userdata(g=TestGoal(300))
        self.assertEqual(action_state(goal_key='g', result_key='r').execute(data), 'succeeded')
        self.assertEqual(data.r.result, 301)

    def test_a_result_comes_with_a_failure_too(self):
        data = userdata()
        self.assertEqual(
            action_state(Behaviour.ABORT, result_slots=['result']).execute(data), 'aborted'
        )
        self.assertEqual(data.result, -1)

    @improvement
    def test_goal_callback_fills_or_replaces_and_leaves_the_scripts_goal_alone(self):
        def fill(ud, goal, step, times=1):
            goal.goal += step * times

        goal, data = TestGoal(100), userdata()
        state = SimpleActionState(
            'work',
            TestAction,
            goal=goal,
            goal_cb=fill,
            goal_cb_args=[10],
            goal_cb_kwargs={'times': 2},
            result_slots=['result'],
        )
        for _ in range(2):
            self.assertEqual(state.execute(data), 'succeeded')
            self.assertEqual(data.result, 121)
        self.assertEqual(goal.goal, 100)
        self.assertEqual(
            action_state(goal_cb=lambda ud, g: TestGoal(400), result_slots=['result']).execute(
                data
            ),
            'succeeded',
        )
        self.assertEqual(data.result, 401)

    def test_callbacks_bring_their_keys_and_outcomes(self):
        @smach.cb_interface(input_keys=['limit'], output_keys=['rest'], outcomes=['enough'])
        def judge(ud, status, result):
            ud.rest = result.result - ud.limit
            return 'enough' if status == GoalStatus.SUCCEEDED else None

        state = action_state(150, result_cb=judge)
        self.assertIn('enough', state.get_registered_outcomes())
        self.assertIn('limit', state.get_registered_input_keys())
        data = userdata(limit=100)
        self.assertEqual(state.execute(data), 'enough')
        self.assertEqual(data.rest, 51)

    def test_a_goal_callback_brings_its_keys_but_no_outcomes_that_nobody_maps(self):
        @smach.cb_interface(input_keys=['number'], outcomes=['filled'])
        def fill(ud, goal):
            goal.goal = ud.number

        state = action_state(goal_cb=fill)
        self.assertEqual(
            set(state.get_registered_outcomes()), {'succeeded', 'aborted', 'preempted'}
        )
        self.assertEqual(state.execute(userdata(number=100)), 'succeeded')

    def test_a_subclass_finds_a_simple_action_client_for_the_states_goal(self):
        state = action_state(150)
        self.assertEqual(state.execute(userdata()), 'succeeded')
        client = state._action_client
        self.assertEqual(client.get_state(), GoalStatus.SUCCEEDED)
        self.assertEqual(client.get_result().result, 151)
        self.assertTrue(client.wait_for_result(rospy.Duration(5.0)))
        self.assertTrue(client.wait_for_server(rospy.Duration(5.0)))
        self.assertEqual(
            client.send_goal_and_wait(TestGoal(100), rospy.Duration(5.0)), GoalStatus.SUCCEEDED
        )
        self.assertEqual(client.get_result().result, 101)

    def test_a_subclass_may_cancel_the_states_goal_through_that_client(self):
        state = action_state(Behaviour.HANG)
        run = InBackground(state, userdata())
        wait_for(lambda: state._action_client.get_state() == GoalStatus.ACTIVE)
        self.assertFalse(state._action_client.wait_for_result(rospy.Duration(0.2)))
        state._action_client.cancel_goal()
        self.assertEqual(run.outcome(5.0), 'aborted')

    def test_the_result_itself_stands_where_the_callback_wrote_to_the_same_key(self):
        def judge(ud, status, result):
            self.assertNotIn('result', ud)
            ud.result = 'from the callback'

        data = userdata()
        self.assertEqual(
            action_state(
                150, result_cb=judge, result_slots=['result'], output_keys=['result']
            ).execute(data),
            'succeeded',
        )
        self.assertEqual(data.result, 151)

    @improvement
    def test_a_callback_that_raises_or_invents_an_outcome_aborts_and_says_so(self):
        with LogWatch() as log:
            self.assertEqual(
                action_state(goal_cb=lambda ud, goal: 1 / 0).execute(userdata()), 'aborted'
            )
            self.assertEqual(
                action_state(150, result_cb=lambda *_: 1 / 0).execute(userdata()), 'aborted'
            )
            self.assertEqual(
                action_state(150, result_cb=lambda *_: 'invented').execute(userdata()), 'aborted'
            )
        self.assertEqual(log.text().count('ZeroDivisionError: division by zero'), 2)
        self.assertIn("'invented'", log.text())

    @improvement
    def test_wrong_arguments_are_named(self):
        for wrong, name in (
            ({'goal_slots': ['gaol']}, 'gaol'),
            ({'result_slots': ['rusult']}, 'rusult'),
            ({'goal_cb': 5}, 'goal_cb'),
            ({'goal': lambda ud: None}, 'goal_cb'),
        ):
            with self.assertRaisesRegex(smach.InvalidStateError, name):
                action_state(**wrong)

    @improvement
    def test_an_invalid_goal_is_refused_and_the_next_one_gets_through(self):
        with self.assertRaisesRegex(smach.InvalidUserCodeError, 'TestGoal'):
            action_state(goal_cb=lambda ud, goal: TestGoal('many')).execute(userdata())
        self.assertEqual(action_state(150).execute(userdata()), 'succeeded')

    @improvement
    def test_overridden_callbacks_are_told_everything(self):
        # status, feedback and result come by a topic each: what is late is not told
        for _ in range(3):
            state = HooksState()
            self.assertEqual(state.execute(userdata()), 'succeeded')
            told, end = state.seen[:-1], state.seen[-1]
            self.assertEqual(end, (GoalStatus.SUCCEEDED, 3))
            feedback = [each for each in told if each != 'active']
            self.assertEqual(feedback, sorted(feedback))
            if sorted(feedback) == [0, 1, 2] and told.count('active') == 1:
                return
        self.fail(state.seen)

    @improvement
    def test_each_preempt_works_not_only_the_first(self):
        state = action_state(Behaviour.HANG)
        for _ in range(3):
            state.active.clear()
            run = InBackground(state, userdata())
            self.assertTrue(state.active.wait(30))
            asked_s = time.monotonic()
            state.request_preempt()
            self.assertEqual(run.outcome(), 'preempted')
            self.assertLess(time.monotonic() - asked_s, 3.0)
            self.assertFalse(state.preempt_requested())

    def test_a_preempt_before_execute_is_not_lost(self):
        state = action_state(Behaviour.HANG)
        state.request_preempt()
        self.assertEqual(state.execute(userdata()), 'preempted')

    @improvement
    def test_a_server_that_succeeds_on_cancel_does_not_swallow_the_machines_preempt(self):
        machine = smach.StateMachine(outcomes=['done', 'preempted', 'aborted'])
        first = action_state(Behaviour.SUCCEED_ON_CANCEL)
        with machine:
            smach.StateMachine.add('FIRST', first, {'succeeded': 'SECOND'})
            smach.StateMachine.add('SECOND', action_state(150), {'succeeded': 'done'})
        for _ in range(2):
            first.active.clear()
            run = InBackground(machine)
            self.assertTrue(first.active.wait(30))
            machine.request_preempt()
            self.assertEqual(run.outcome(), 'preempted')

    def test_exec_timeout_cancels_and_aborts(self):
        state = action_state(Behaviour.HANG, exec_timeout=rospy.Duration(0.3))
        run = InBackground(state, userdata())
        self.assertEqual(run.outcome(), 'aborted')
        self.assertLess(run.took_s(), 20.0)  # not the minute that a server has for a cancel

    def test_no_time_at_all_means_no_limit(self):
        state = action_state(Behaviour.HANG, exec_timeout=rospy.Duration(0))
        run = InBackground(state, userdata())
        self.assertEqual(run.outcome(0.5), 'still running')
        state.request_preempt()
        self.assertEqual(run.outcome(), 'preempted')

    @improvement
    def test_an_absent_server_aborts_after_its_time_and_a_preempt_does_not_wait_for_it(self):
        absent = SimpleActionState('absent', TestAction, server_wait_timeout=rospy.Duration(0.5))
        with LogWatch() as log:
            self.assertEqual(InBackground(absent, userdata()).outcome(), 'aborted')
        self.assertIn("'absent' did not come", log.text())
        patient = SimpleActionState('absent', TestAction)
        run = InBackground(patient, userdata())
        self.assertTrue(run.waits())
        patient.request_preempt()
        # not after the minute that a server may take to come
        self.assertEqual(run.outcome(20.0), 'preempted')

    @improvement
    def test_ctrl_c_ends_the_state_and_cancels_the_goal(self):
        statuses = {}
        rospy.Subscriber(
            'work/status',
            GoalStatusArray,
            lambda message: statuses.update(
                {status.goal_id.id: status.status for status in message.status_list}
            ),
        )
        script = subprocess.Popen(
            [sys.executable, HERE + '/smach_ros_hanging_script.py'], stdout=subprocess.PIPE
        )
        goals = lambda: [goal for goal in statuses if 'hanging_script' in goal]  # noqa: E731
        self.assertTrue(
            wait_for(lambda: any(statuses[goal] == GoalStatus.ACTIVE for goal in goals()))
        )
        begin = time.monotonic()
        script.send_signal(2)
        said, _ = script.communicate(timeout=20)
        self.assertLess(time.monotonic() - begin, 5.0)
        self.assertIn(b'ended: preempted', said)
        self.assertTrue(wait_for(lambda: statuses[goals()[0]] == GoalStatus.PREEMPTED), statuses)


if __name__ == '__main__':
    rospy.init_node('smach_ros_action_state')
    rostest.rosrun('smach_oracle', 'smach_ros_action_state', SimpleActionStateTest)
