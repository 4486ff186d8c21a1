#!/usr/bin/env python3
"""The ROS master is killed and restarted in mid-trial: the trial ends as it would have, and the
node can be found.
"""

import json
import sys
import time
import unittest
from typing import Any

from oracle_support import OwnMaster, Process, oracle_run, script
from waiting import stays, wait_for

TASK = """
import sys, rospy, smach
rospy.init_node('task')
class Fails(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'])
    def execute(self, userdata):
        print('RUNNING', flush=True)
        sys.stdin.readline()
        return 'aborted'
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('PICK', Fails())
print('OUTCOME {}'.format(sm.execute()), flush=True)
sys.stdin.readline()
"""
# A front end that knows nothing of what was before: finds the server, waits for a question, answers
# it.
FRONT_END = """
import rospy
from smach_oracle.msg import ExpertDecision, OpenQueries
from smach_oracle.srv import AnswerQuery
rospy.init_node('front_end')
answer = rospy.ServiceProxy('/task/expert_query/answer', AnswerQuery)
while not rospy.is_shutdown():
    queries = rospy.wait_for_message('/task/expert_query/open', OpenQueries, 20.0).queries
    if queries:
        answer.wait_for_service(20.0)
        decision = ExpertDecision(kind=ExpertDecision.SUPERSEDE, outcome='succeeded', by='Ann')
        reply = answer(queries[0].query.query_id, decision)
        print('ANSWERED', reply.ok, reply.message, flush=True)
        break
    rospy.sleep(0.1)
"""
LISTENER = """
import rospy
from smach_oracle.msg import OracleEvent
rospy.init_node('listener')
events = rospy.Subscriber('/task/oracle/events', OracleEvent,
                          lambda event: print('EVENT {}'.format(event.kind), flush=True))
while not events.get_num_connections():
    rospy.sleep(0.05)
print('LISTENING', flush=True)
rospy.spin()
"""


class MasterRestartTest(unittest.TestCase):
    def setUp(self) -> None:
        self.master = OwnMaster(self)

    def python(self, text: str) -> Process:
        process = Process([sys.executable, '-c', text], self.master.env)
        self.addCleanup(process.stop)
        return process

    def start_task(self, *options: str) -> Process:
        task = oracle_run(self, *options, script(self, TASK), env=self.master.env)
        self.assertTrue(task.says('RUNNING'), task.output())
        return task

    def restart_master(self, gap_s: float = 0.0) -> None:
        self.master.kill()
        time.sleep(gap_s)  # so long there is no master
        self.master.start()

    def registered(self) -> bool:
        system = self.master.system()
        return (
            '/task/oracle/events' in system['publishers']
            and '/task/expert_query/goal' in system['subscribers']
            and '/task/expert_query/answer' in system['services']
        )

    def test_a_front_end_started_after_the_restart_can_answer_the_question_that_was_open(
        self,
    ) -> None:
        task = self.ask_at_once()
        before = self.master.system()
        self.restart_master()
        wait_for(lambda: self.own_names(self.master.system()) == self.own_names(before))
        self.assertEqual(self.own_names(before), self.own_names(self.master.system()))
        front_end = self.python(FRONT_END)
        self.assertTrue(front_end.says('ANSWERED True', 40.0), front_end.output() + task.output())
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        task.go_on()
        self.assertEqual(task.wait(), 0)

    def test_a_trial_without_a_question_ends_as_it_would_have(self) -> None:
        task = self.start_task('--without-oracle')
        self.restart_master(gap_s=2.0)
        task.go_on()
        self.assertTrue(task.says('OUTCOME aborted'), task.output())
        self.assertTrue(wait_for(self.registered_events), self.master.system())
        task.go_on()
        self.assertEqual(task.wait(), 0)

    def test_a_trial_that_begins_to_ask_while_the_master_is_away_goes_on_when_it_is_back(
        self,
    ) -> None:
        task = self.start_task('--config', self.asking())
        self.master.kill()
        task.go_on()  # the state fails now
        self.assertTrue(task.says('PICK failed'), task.output())
        self.assertTrue(stays(task.running, 1.0), task.output())
        self.master.start()
        self.assertTrue(wait_for(self.registered), self.master.system())
        front_end = self.python(FRONT_END)
        self.assertTrue(front_end.says('ANSWERED True', 40.0), front_end.output() + task.output())
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())

    def test_a_subscriber_that_comes_after_the_restart_is_served(self) -> None:
        task = self.ask_at_once()
        self.restart_master()
        listener = self.python(LISTENER)
        self.assertTrue(listener.says('LISTENING'), listener.output())
        front_end = self.python(FRONT_END)
        self.assertTrue(front_end.says('ANSWERED True', 40.0), front_end.output() + task.output())
        task.says('OUTCOME')
        self.assertTrue(listener.says('EVENT'), listener.output())

    def ask_at_once(self) -> Process:
        """A task whose question is open."""
        task = self.start_task('--config', self.asking())
        task.go_on()
        self.assertTrue(task.says('PICK failed'), task.output())
        self.assertTrue(task.says('the expert is asked'), task.output())
        self.assertTrue(wait_for(self.registered), self.master.system())
        return task

    def asking(self) -> str:
        return script(
            self, json.dumps({'max_recoveries': 0, 'expert': {'deadline_s': 60}}), 'oracle.yaml'
        )

    def registered_events(self) -> bool:
        return '/task/oracle/events' in self.master.system()['publishers']

    @staticmethod
    def own_names(system: Any) -> Any:
        # connections of others come and go; what is compared is what the node itself offers
        return {
            kind: sorted(name for name in names if name.startswith('/task/'))
            for kind, names in system.items()
        }


if __name__ == '__main__':
    import rostest

    rostest.rosrun('smach_oracle', 'fault_master_restart', MasterRestartTest, sys.argv)
