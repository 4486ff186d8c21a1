#!/usr/bin/env python3
"""States and action servers that misbehave, in a script under oracle_run with a real expert: the
robot goes on.
"""

import json
import sys
import tempfile
import threading
import unittest
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import rospy
from oracle_support import FrontEnd, Process, oracle_run, recorded_events, script
from smach_ros_support import improvement
from waiting import wait_for

from smach_oracle.msg import ExpertDecision, OracleEvent
from smach_oracle.srv import AnswerQueryRequest, AnswerQueryResponse

STATES = '''
import sys, time, rospy, smach, smach_ros
rospy.init_node('task')
class Odd(smach.State):
    """Misbehaves the first time, then succeeds."""
    def __init__(self, first):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'])
        self.first = first
        self.visits = 0
    def execute(self, userdata):
        self.visits += 1
        print('VISIT {}'.format(self.visits), flush=True)
        return self.first() if self.visits == 1 else 'succeeded'
def raises():
    raise RuntimeError('the gripper is not calibrated')
def hangs():
    while True:
        time.sleep(0.1)
first = {'raises': raises, 'returns_none': lambda: None, 'hangs': hangs,
         'fine': lambda: 'succeeded', 'aborts': lambda: 'aborted'}[sys.argv[1]]
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('PICK', Odd(first), {'succeeded': 'PLACE'})
    smach.StateMachine.add('PLACE', Odd(lambda: 'succeeded'))
print('WAITS', flush=True)
sys.stdin.readline()
print('OUTCOME {}'.format(sm.execute()), flush=True)
if sys.argv[2:] == ['stay']:
    sys.stdin.readline()
'''
ACTION = """
import sys, time, rospy, smach, smach_ros
from smach_oracle.msg import MoveArmsAsideAction
rospy.init_node('task')
move = smach_ros.SimpleActionState('move', MoveArmsAsideAction,
                                   server_wait_timeout=rospy.Duration(20.0))
try:
    from smach_ros.action_link import link_to
    ready = link_to('move', MoveArmsAsideAction).ready
except ImportError:  # upstream's states have a client each
    ready = lambda: move._action_client.wait_for_server(rospy.Duration(0.02))
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('MOVE', move)
while not ready():
    # a state's limit counts from its entry: it is for the goal, not for the connections
    time.sleep(0.02)
print('WAITS', flush=True)
sys.stdin.readline()
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
# Takes each goal and does nothing with it, unless told to succeed.
SILENT_SERVER = """
import sys, time, rospy, actionlib
from smach_oracle.msg import MoveArmsAsideAction
rospy.init_node('server', anonymous=True)
def execute(goal):
    print('GOAL', flush=True)
    while not (rospy.is_shutdown() or 'succeed' in sys.argv):
        time.sleep(0.1)
    server.set_succeeded()
server = actionlib.SimpleActionServer('move', MoveArmsAsideAction, execute, auto_start=False)
server.start()
print('READY', flush=True)
rospy.spin()
"""


START_S = 60.0


class FaultyStatesTest(unittest.TestCase):
    def start(self, text: str, *args: str, **settings: Any) -> Process:
        """Start a script that waits for a line before it runs its machine."""
        config = script(
            self, json.dumps(dict({'expert': {'deadline_s': 30}}, **settings)), 'oracle.yaml'
        )
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.bags = folder.name
        self.expert = FrontEnd(self, '/task/expert_query')
        task = oracle_run(
            self, '--config', config, '--record', self.bags, script(self, text), *args
        )
        # the first program of a machine that has just begun reads all from the disk: no test is
        # about that time
        self.assertTrue(task.says('WAITS', START_S), task.output())
        return task

    def check_recovered(self, task: Process, kind: int) -> None:
        """One failure of this kind, then success."""
        task.go_on()
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        self.assertEqual(task.wait(), 0)
        (events,) = recorded_events(self.bags)
        failures = [
            (event.state, event.failure_kind)
            for event in events
            if event.kind == OracleEvent.FAILURE
        ]
        self.assertEqual(failures, [('PICK', kind)])
        self.assertEqual(
            [event.target for event in events if event.kind == OracleEvent.JUMP], ['PICK']
        )

    def test_a_state_that_raises_is_recovered_from(self) -> None:
        task = self.start(STATES, 'raises')
        self.check_recovered(task, OracleEvent.EXCEPTION)
        self.assertIn('the gripper is not calibrated', task.output())

    def test_a_state_that_returns_none_is_recovered_from(self) -> None:
        self.check_recovered(self.start(STATES, 'returns_none'), OracleEvent.UNREGISTERED_OUTCOME)

    def test_a_state_that_never_returns_is_left_behind_and_the_expert_is_told(self) -> None:
        task = self.start(
            STATES,
            'hangs',
            states={'PICK': {'time_limit_s': 0.5, 'grace_period_s': 0.2}},
            max_recoveries=0,
        )
        task.go_on()
        question = self.expert.question(state='PICK')
        self.assertIsNotNone(question, task.output())
        self.assertEqual(question.query.failure_kind, OracleEvent.TIME_LIMIT)
        blocked = {choice.state: choice.blocked for choice in question.query.choices}
        self.assertTrue(blocked['PICK'], 'its thread still runs')
        self.assertEqual(blocked['PLACE'], '')
        self.answer(question, kind=ExpertDecision.SUPERSEDE, outcome='succeeded')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        self.assertEqual(task.wait(10.0), 0)  # the thread that hangs does not keep the process

    def test_a_state_that_is_never_repeated_is_refused_with_the_reason(self) -> None:
        task = self.start(STATES, 'aborts', states={'PICK': {'on_retry': 'never'}})
        task.go_on()
        question = self.expert.question(state='PICK')
        self.assertIsNotNone(question, task.output())
        self.assertIn('it is not repeated by itself', question.query.reason)
        self.assertEqual([bool(choice.blocked) for choice in question.query.choices], [True, False])
        reply = self.expert.answer(self.request(question, kind=ExpertDecision.GOTO, state='PICK'))
        self.assertFalse(reply.ok)
        self.assertIn('must not be repeated', reply.message)
        self.answer(question, kind=ExpertDecision.SUPERSEDE, outcome='succeeded')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        self.assertEqual(task.output().count('VISIT 1'), 2)  # of PICK and of PLACE
        self.assertNotIn('VISIT 2', task.output())

    def test_an_expert_confirms_that_a_state_is_repeated(self) -> None:
        task = self.start(STATES, 'aborts', states={'PICK': {'on_retry': 'confirm'}})
        task.go_on()
        question = self.expert.question(state='PICK')
        self.assertIsNotNone(question, task.output())
        self.assertEqual([choice.repeats for choice in question.query.choices], [['PICK'], []])
        self.answer(question, kind=ExpertDecision.GOTO, state='PICK')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        self.assertIn('VISIT 2', task.output())

    def test_an_answer_that_names_an_unknown_state_is_refused_and_the_question_stays(self) -> None:
        task = self.start(STATES, 'aborts', max_recoveries=0)
        task.go_on()
        question = self.expert.question(state='PICK')
        self.assertIsNotNone(question, task.output())
        reply = self.expert.answer(
            self.request(question, kind=ExpertDecision.GOTO, state='NOWHERE')
        )
        self.assertFalse(reply.ok)
        for part in ('NOWHERE', 'PICK', 'PLACE'):  # what was wrong, what is allowed
            self.assertIn(part, reply.message)
        self.assertNotIn('OUTCOME', task.output())
        self.answer(question, kind=ExpertDecision.GOTO, state='PICK')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())

    def test_of_two_experts_who_answer_at_once_one_is_heard_and_the_other_told(self) -> None:
        task = self.start(STATES, 'aborts', 'stay', max_recoveries=0)
        task.go_on()
        question = self.expert.question(state='PICK')
        self.assertIsNotNone(question, task.output())
        requests = {
            'Ann': self.request(question, 'Ann', kind=ExpertDecision.GOTO, state='PICK'),
            'Bob': self.request(
                question, 'Bob', kind=ExpertDecision.SUPERSEDE, outcome='succeeded'
            ),
        }
        at_once = threading.Barrier(2)

        def answer(name: str) -> AnswerQueryResponse:
            at_once.wait()
            return self.expert.answer(requests[name])

        with ThreadPoolExecutor(2) as experts:
            replies = dict(zip(requests, experts.map(answer, requests)))
        heard, told = sorted(replies, key=lambda name: not replies[name].ok)
        self.assertEqual([replies[heard].ok, replies[told].ok], [True, False])
        self.assertIn(heard, replies[told].message)
        self.assertEqual(replies[told].settled.by, heard)
        self.assertTrue(self.expert.answer(requests[heard]).ok, 'the same answer again is accepted')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        self.assertEqual(task.output().count('VISIT'), {'Ann': 3, 'Bob': 2}[heard])
        task.go_on()

    def test_a_front_end_that_is_gone_with_its_claim_does_not_keep_the_others_out(self) -> None:
        task = self.start(STATES, 'aborts', max_recoveries=0)
        task.go_on()
        question = self.expert.question(state='PICK')
        self.assertIsNotNone(question, task.output())
        # for so long, never renewed
        gone = self.expert.claim(1, question.query.query_id, 'Bob', 3.0)
        self.assertTrue(gone.ok, gone.message)
        self.assertFalse(self.expert.claim(1, question.query.query_id, 'Ann', 10.0).ok)
        self.assertTrue(
            wait_for(lambda: self.expert.claim(1, question.query.query_id, 'Ann', 10.0).ok)
        )
        self.answer(question, kind=ExpertDecision.GOTO, state='PICK')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())

    def test_without_an_answer_the_machine_ends_as_it_would_have(self) -> None:
        task = self.start(STATES, 'aborts', max_recoveries=0, expert={'deadline_s': 1.0})
        task.go_on()
        self.assertTrue(task.says('OUTCOME aborted'), task.output())

    @improvement
    def test_an_action_server_that_dies_with_a_goal_is_asked_again_when_it_is_back(self) -> None:
        server = self.server()
        task = self.start(ACTION, states={'MOVE': {'time_limit_s': 30.0}})
        task.go_on()
        self.assertTrue(server.says('GOAL'), server.output() + task.output())
        server.stop()  # SIGKILL
        self.server('succeed')
        self.assertTrue(task.says('OUTCOME succeeded', 40.0), task.output())
        self.assertEqual(task.wait(), 0)
        (events,) = recorded_events(self.bags)
        self.assertIn(
            'MOVE', [event.state for event in events if event.kind == OracleEvent.FAILURE]
        )

    def test_an_action_server_that_never_answers_runs_into_the_time_limit(self) -> None:
        server = self.server()
        task = self.start(
            ACTION, states={'MOVE': {'time_limit_s': 1.0, 'grace_period_s': 0.5}}, max_recoveries=0
        )
        task.go_on()
        self.assertTrue(server.says('GOAL'), server.output() + task.output())
        question = self.expert.question(state='MOVE')
        self.assertIsNotNone(question, task.output())
        self.assertEqual(question.query.failure_kind, OracleEvent.TIME_LIMIT)
        self.answer(question, kind=ExpertDecision.SUPERSEDE, outcome='succeeded')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())

    def server(self, *args: str) -> Process:
        server = Process([sys.executable, '-c', SILENT_SERVER] + list(args))
        self.addCleanup(server.stop)
        self.assertTrue(server.says('READY'), server.output())
        return server

    def answer(self, question: Any, **decision: Any) -> None:
        reply = self.expert.answer(self.request(question, **decision))
        self.assertTrue(reply.ok, reply.message)

    @staticmethod
    def request(question: Any, by: str = 'Ann', **decision: Any) -> AnswerQueryRequest:
        return AnswerQueryRequest(question.query.query_id, ExpertDecision(by=by, **decision))


if __name__ == '__main__':
    import rostest

    rospy.init_node('fault_states')
    rostest.rosrun('smach_oracle', 'fault_states', FaultyStatesTest, sys.argv)
