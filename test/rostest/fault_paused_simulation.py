#!/usr/bin/env python3
"""Simulated time that never begins, and a robot pushed into a namespace: limits, deadlines and
answers work on.
"""

import signal
import sys
import tempfile
import time
import unittest

import rospy
from oracle_support import EventLog, FrontEnd, Process, oracle_run, recorded_events, script

from smach_oracle.msg import ExpertDecision, OracleEvent
from smach_oracle.srv import AnswerQueryRequest

HANGS_ONCE = """
import time, rospy, smach
rospy.init_node('task')
class Pick(smach.State):
    visits = 0
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
    def execute(self, userdata):
        self.visits += 1
        while self.visits == 1:
            time.sleep(0.05)
            if self.preempt_requested():
                self.service_preempt()
                return 'preempted'
        return 'succeeded'
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('PICK', Pick())
print('OUTCOME', sm.execute(), rospy.get_time(), flush=True)
"""
LIMITED = 'states: {PICK: {time_limit_s: 0.5, max_recoveries: 0}}\n'


class PausedSimulationTest(unittest.TestCase):
    def start(self, settings: str, *args: str) -> Process:
        config = script(self, LIMITED + settings, 'oracle.yaml')
        return oracle_run(
            self, '--config', config, *args, script(self, HANGS_ONCE), '__ns:=/robots/one'
        )

    def test_a_time_limit_and_a_deadline_pass_though_the_clock_stands(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            task = self.start('expert: {deadline_s: 1.0}\n', '--record', folder)
            self.assertEqual(task.wait(), 0, task.output())
            self.assertIn('OUTCOME aborted 0.0', task.output())
            kinds = [event.kind for event in recorded_events(folder, 'robots/one/task')[0]]
        for kind in (
            OracleEvent.FAILURE,
            OracleEvent.QUERY_OPENED,
            OracleEvent.QUERY_EXPIRED,
            OracleEvent.TRIAL_END,
        ):
            self.assertIn(kind, kinds)

    def test_an_expert_answers_a_robot_in_a_namespace(self) -> None:
        log = EventLog(self, 'robots/one/task')
        front_end = FrontEnd(self, '/robots/one/task/expert_query')
        task = self.start('expert: {deadline_s: 60.0}\n')
        question = front_end.question(state='PICK')
        self.assertTrue(question, task.output())
        reply = front_end.answer(
            AnswerQueryRequest(
                question.query.query_id,
                ExpertDecision(kind=ExpertDecision.GOTO, state='PICK', by='Ann'),
            )
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertEqual(task.wait(), 0, task.output())
        self.assertIn('OUTCOME succeeded 0.0', task.output())
        self.assertEqual([event.by for event in log.of(OracleEvent.JUMP)], ['Ann'])

    def test_ctrl_c_ends_it_in_time(self) -> None:
        front_end = FrontEnd(self, '/robots/one/task/expert_query')
        task = self.start('expert: {deadline_s: 0}\n')
        self.assertTrue(front_end.question(state='PICK'), task.output())
        began = time.monotonic()
        task.signal(signal.SIGINT)
        task.wait()
        # 2 s, on a machine that has nothing else to do
        self.assertLess(time.monotonic() - began, 6.0)
        self.assertIn('OUTCOME preempted', task.output())


if __name__ == '__main__':
    import rostest

    rospy.init_node('fault_paused_simulation')
    rostest.rosrun('smach_oracle', 'fault_paused_simulation', PausedSimulationTest, sys.argv)
