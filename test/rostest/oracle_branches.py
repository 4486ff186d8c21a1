#!/usr/bin/env python3
"""A script with an Iterator and a Concurrence: an expert is asked about the item, the branch."""

import json
import sys
import unittest

import rospy
from oracle_support import FrontEnd, oracle_run, script

from smach_oracle.msg import ExpertDecision
from smach_oracle.srv import AnswerQueryRequest

SCRIPT = '''
import rospy, smach
rospy.init_node('task')
class Once(smach.State):
    """Fails the first time at what it is told; says what it does."""
    def __init__(self, name, at=None):
        smach.State.__init__(self, ['succeeded', 'aborted'], input_keys=['part'])
        self.name, self.at = name, at
    def execute(self, ud):
        part = ud.part if 'part' in ud else ''
        # in one write: branches print at once
        print('DOES {} {}\\n'.format(self.name, part), end='', flush=True)
        if part == self.at or self.at == 'first':
            self.at = None
            return 'aborted'
        return 'succeeded'
polish = smach.Iterator(['succeeded', 'aborted'], input_keys=[], output_keys=[], it='abcd',
                        it_label='part', exhausted_outcome='succeeded')
with polish:
    smach.Iterator.set_contained_state('POLISH', Once('POLISH', 'b'), loop_outcomes=['succeeded'])
both = smach.Concurrence(['succeeded', 'aborted'], 'aborted', outcome_map={
    'succeeded': {'LIFT': 'succeeded', 'LOOK': 'succeeded'}})
with both:
    smach.Concurrence.add('LIFT', Once('LIFT', 'first'))
    smach.Concurrence.add('LOOK', Once('LOOK'))
sm = smach.StateMachine(['succeeded', 'aborted'])
with sm:
    smach.StateMachine.add('ALL', polish, {'succeeded': 'BOTH'})
    smach.StateMachine.add('BOTH', both)
print('OUTCOME {}'.format(sm.execute()), flush=True)
'''
SETTINGS = {
    'states': {'ALL/*': {'max_recoveries': 0}, 'BOTH/LIFT': {'max_recoveries': 0}},
    'tree': {'escalate': False},
    'expert': {'deadline_s': 50},
}


class BranchesTest(unittest.TestCase):
    def test_an_expert_skips_an_item_and_repeats_a_branch(self) -> None:
        config = script(self, json.dumps(SETTINGS), 'oracle.yaml')
        expert = FrontEnd(self, '/task/expert_query')
        task = oracle_run(self, '--config', config, script(self, SCRIPT))
        question = expert.question(state='POLISH')
        self.assertIsNotNone(question, task.output())
        self.assertEqual(question.query.text, 'item 2 of 4')
        self.assertTrue(question.query.container_path.endswith('/ALL'))
        self.assertEqual(
            {choice.outcome: choice.target for choice in question.query.supersede_outcomes}[
                'succeeded'
            ],
            'the next item',
        )
        self._answer(expert, question, kind=ExpertDecision.SUPERSEDE, outcome='succeeded')
        question = expert.question(state='LIFT')
        self.assertIsNotNone(question, task.output())
        self._answer(expert, question, kind=ExpertDecision.GOTO, state='LIFT')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        done = [line for line in task.output().splitlines() if line.startswith('DOES')]
        self.assertEqual(
            [line.split()[1:] for line in done if 'POLISH' in line],
            [['POLISH', part] for part in 'abcd'],
        )
        self.assertEqual(sum('LIFT' in line for line in done), 2)
        self.assertEqual(sum('LOOK' in line for line in done), 1)

    def _answer(self, expert: FrontEnd, question: object, **decision: object) -> None:
        reply = expert.answer(
            AnswerQueryRequest(question.query.query_id, ExpertDecision(by='Ann', **decision))
        )
        self.assertTrue(reply.ok, reply.message)


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_branches')
    rostest.rosrun('smach_oracle', 'oracle_branches', BranchesTest, sys.argv)
