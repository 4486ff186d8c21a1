#!/usr/bin/env python3
"""The expert reads why an action was aborted, in the action server's own words."""

import json
import sys
import unittest

import actionlib
import rospy
from oracle_support import FrontEnd, oracle_run, script

from smach_oracle.msg import ExpertDecision, MoveArmsAsideAction
from smach_oracle.srv import AnswerQueryRequest

REASON = 'the left arm is blocked by the shelf'
SCRIPT = """
import rospy, smach, smach_ros
from smach_oracle.msg import MoveArmsAsideAction
rospy.init_node('task')
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('MOVE', smach_ros.SimpleActionState('move', MoveArmsAsideAction))
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""


class FailureTextTest(unittest.TestCase):
    def test_the_words_of_the_action_server_reach_the_expert(self) -> None:
        server = actionlib.SimpleActionServer(
            'move',
            MoveArmsAsideAction,
            auto_start=False,
            execute_cb=lambda goal: server.set_aborted(text=REASON),
        )
        server.start()
        config = script(
            self, json.dumps({'max_recoveries': 0, 'expert': {'deadline_s': 30}}), 'oracle.yaml'
        )
        expert = FrontEnd(self, '/task/expert_query')
        task = oracle_run(self, '--config', config, script(self, SCRIPT))
        question = expert.question(state='MOVE')
        self.assertIsNotNone(question, task.output())
        self.assertEqual(question.query.outcome, 'aborted')
        self.assertIn(REASON, question.query.text)
        self.assertIn(REASON, task.output())
        reply = expert.answer(
            AnswerQueryRequest(
                question.query.query_id, ExpertDecision(kind=ExpertDecision.GIVE_UP, by='Ann')
            )
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(task.says('OUTCOME aborted'), task.output())


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_failure_text')
    rostest.rosrun('smach_oracle', 'oracle_failure_text', FailureTextTest, sys.argv)
