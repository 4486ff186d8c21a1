#!/usr/bin/env python3
"""A failure three levels down: asked about once, and answered with a state of another container."""

import json
import sys
import unittest

import rospy
from oracle_support import FrontEnd, oracle_run, script

from smach_oracle.msg import ExpertDecision
from smach_oracle.srv import AnswerQueryRequest

SCRIPT = """
import rospy, smach
from smach_ros import IntrospectionServer
rospy.init_node('task')
OUTCOMES = ['succeeded', 'aborted', 'preempted']
visits = []

class Step(smach.State):
    def __init__(self, name, *outcomes):
        smach.State.__init__(self, outcomes=OUTCOMES)
        self.name, self.script = name, list(outcomes)
    def execute(self, ud):
        visits.append(self.name)
        return self.script.pop(0) if self.script else 'succeeded'

def chain(*states):
    machine = smach.StateMachine(outcomes=list(OUTCOMES))
    with machine:
        for index, (label, state) in enumerate(states):
            following = states[index + 1][0] if index + 1 < len(states) else 'succeeded'
            smach.StateMachine.add(label, state, {'succeeded': following})
    return machine

sm = chain(('FIND', chain(('LOOK', Step('LOOK')), ('AIM', Step('AIM')))),
           ('PICK', chain(('ARM', chain(('REACH', Step('REACH')),
                                        ('GRASP', Step('GRASP', 'aborted', 'aborted')))))),
           ('PLACE', Step('PLACE')))
server = IntrospectionServer('task', sm, '/TASK')
server.start()
outcome = sm.execute()
print('VISITS {}'.format(' '.join(visits)), flush=True)
print('OUTCOME {}'.format(outcome), flush=True)
server.stop()
"""


class TreesTest(unittest.TestCase):
    def setUp(self) -> None:
        config = script(
            self, json.dumps({'max_recoveries': 0, 'expert': {'deadline_s': 60}}), 'oracle.yaml'
        )
        self.expert = FrontEnd(self, '/task/expert_query')
        self.task = oracle_run(self, '--config', config, script(self, SCRIPT))

    def answer(self, other_than='', **decision):
        question = self.expert.question(state='GRASP', other_than=other_than)
        self.assertIsNotNone(question, self.task.output())
        reply = self.expert.answer(
            AnswerQueryRequest(question.query.query_id, ExpertDecision(by='Ann', **decision))
        )
        return question.query, reply

    def test_the_machine_goes_where_it_is_sent(self) -> None:
        query, reply = self.answer(kind=ExpertDecision.GOTO, container='task/NOWHERE', state='AIM')
        self.assertFalse(reply.ok)
        self.assertIn('has no state', reply.message)
        self.assertEqual(query.container_path, 'task/PICK/ARM')
        self.assertEqual(
            [(choice.container, choice.state) for choice in query.choices],
            [
                ('', 'REACH'),
                ('', 'GRASP'),
                ('task/PICK', 'ARM'),
                ('task', 'FIND'),
                ('task', 'PICK'),
                ('task', 'PLACE'),
                ('task/FIND', 'LOOK'),
                ('task/FIND', 'AIM'),
            ],
        )
        _, reply = self.answer(kind=ExpertDecision.GOTO, container='task/FIND', state='AIM')
        self.assertTrue(reply.ok, reply.message)
        query, reply = self.answer(
            other_than=query.query_id, kind=ExpertDecision.SUPERSEDE, outcome='succeeded'
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(self.task.says('OUTCOME succeeded'), self.task.output())
        self.assertIn('VISITS LOOK AIM REACH GRASP AIM REACH GRASP PLACE', self.task.output())

    def test_a_container_above_is_given_up_and_nobody_is_asked_again(self) -> None:
        _, reply = self.answer(
            kind=ExpertDecision.GIVE_UP, container='task/PICK', outcome='succeeded'
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(self.task.says('OUTCOME succeeded'), self.task.output())
        self.assertIn('VISITS LOOK AIM REACH GRASP PLACE', self.task.output())


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_trees')
    rostest.rosrun('smach_oracle', 'oracle_trees', TreesTest, sys.argv)
