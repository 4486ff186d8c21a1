#!/usr/bin/env python3
"""A script under oracle_run is killed with SIGKILL, and run again: it goes on where it stood."""

import os
import signal

import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from oracle_support import EventLog, FrontEnd, oracle_run, script
from smach_ros_action_node import Behaviour
from survive_support import EXPERTS, SUCCEED, SurvivingCase
from waiting import wait_for

from smach_oracle.msg import ExpertDecision, OracleEvent
from smach_oracle.srv import AnswerQueryRequest


class KilledTest(SurvivingCase):
    def test_a_goal_of_the_killed_program_has_ended_before_anything_is_sent(self):
        task, traffic = self.run_until_it_moves()
        self.kill(task)
        again = self.run_task('--resume')
        self.assertTrue(again.says('OUTCOME succeeded', 40.0), again.output())
        self.assertEqual(again.wait(), 0, again.output())
        self.assertTrue(wait_for(lambda: len(traffic.results) == 2), traffic.results)
        first, second = traffic.results
        self.assertEqual(
            (first.status.status, second.status.status),
            (GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED),
        )
        self.assertGreater(second.status.goal_id.stamp, first.header.stamp)
        self.assertNotIn('LOOKS', again.output())
        self.assertIn('SEEN 1.5 [[0, 1, 2], [3, 4, 5]]', again.output())

    def test_a_question_that_was_open_is_open_again_and_answered_once(self):
        expert = FrontEnd(self, EXPERTS)
        asks = ('--config', self.settings)
        task = self.run_task(*asks, told='aborted')
        entry = expert.question(30.0)
        self.assertIsNotNone(entry, task.output())
        self.kill(task)
        again = self.run_task('--resume', *asks)
        self.assertTrue(again.says('goes on'), again.output())
        log = EventLog(self, 'task')
        self.assertTrue(wait_for(log.connected))
        found = expert.question(30.0, 'TELL')
        self.assertEqual(found.query.query_id, entry.query.query_id)
        reply = expert.answer(
            AnswerQueryRequest(
                query_id=entry.query.query_id,
                decision=ExpertDecision(kind=ExpertDecision.GOTO, state='TELL', by='Ann'),
            )
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(again.says('OUTCOME succeeded', 30.0), again.output())
        self.assertEqual(len(log.wait_for(OracleEvent.QUERY_ANSWERED)), 1)
        self.assertEqual(again.output().count('SEEN'), 1)
        later = expert.answer(
            AnswerQueryRequest(
                query_id=entry.query.query_id,
                decision=ExpertDecision(kind=ExpertDecision.GIVE_UP, outcome='aborted', by='Bob'),
            )
        )
        self.assertFalse(later.ok)

    def test_a_signal_while_a_question_is_open_leaves_the_trial_to_go_on(self):
        expert = FrontEnd(self, EXPERTS)
        asks = ('--config', self.settings)
        task = self.run_task(*asks, told='aborted')
        ids = [expert.question(40.0, 'TELL').query.query_id]
        for number in (signal.SIGINT, signal.SIGTERM):
            task.signal(number)
            task.wait(40.0)
            self.assertNotIn('OUTCOME aborted', task.output())
            self.assertTrue(wait_for(lambda: expert.question(0.1) is None))
            task = self.run_task(*asks, told='aborted')  # asks first, as nobody said `--resume`
            self.assertTrue(task.says('goes on', 40.0), task.output())
            ids.append(expert.question(40.0, 'TELL').query.query_id)
        self.assertEqual(len(set(ids)), 1)
        reply = expert.answer(
            AnswerQueryRequest(
                query_id=ids[0],
                decision=ExpertDecision(kind=ExpertDecision.GIVE_UP, outcome='aborted', by='Ann'),
            )
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(task.says('OUTCOME aborted', 40.0), task.output())

    def test_a_trial_for_which_nobody_answers_is_kept(self):
        task = self.run_task(goal=Behaviour.HANG)
        self.assertTrue(task.says('LOOKS', 40.0), task.output())
        self.kill(task)
        hurried = script(self, 'expert: {deadline_s: 1}\n', 'hurried.yaml')
        for _ in range(2):
            again = self.run_task('--config', hurried)
            again.wait(60.0)
            self.assertIn('the trial is kept', again.output())
            self.assertIn('OUTCOME None', again.output())
            self.assertNotIn('SEEN', again.output())
        resumed = self.run_task('--resume')
        self.assertTrue(resumed.says('OUTCOME succeeded', 60.0), resumed.output())

    def test_with_nothing_stored_it_begins_anew_and_says_so(self):
        task = self.run_task('--resume')
        self.assertTrue(task.says('OUTCOME succeeded', 40.0), task.output())
        self.assertIn('has no trial that was stopped: a new one begins', task.output())
        self.assertIn('LOOKS', task.output())

    def test_the_private_parameter_names_the_store(self):
        task = oracle_run(
            self, self.script, str(SUCCEED), 'succeeded', '_checkpoint:=' + self.store
        )
        self.assertTrue(task.says('OUTCOME succeeded', 40.0), task.output())
        self.assertTrue(os.path.exists(self.store))

    def test_without_a_store_nothing_can_be_resumed(self):
        task = oracle_run(self, '--resume', self.script, str(SUCCEED), 'succeeded')
        self.assertEqual(task.wait(40.0), 2, task.output())
        self.assertIn('checkpoint', task.output())


if __name__ == '__main__':
    rospy.init_node('survive_killed')
    rostest.rosrun('smach_oracle', 'survive_killed', KilledTest)
