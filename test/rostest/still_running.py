#!/usr/bin/env python3
"""Action states that never end after a recovery: a person is asked while they run."""

import json
import signal
import sys
import tempfile
import threading
import unittest
from typing import Any, List

import actionlib
import rospy
from oracle_support import FrontEnd, Process, oracle_run, recorded_events, script
from waiting import wait_for

from smach_oracle.analysis.trials import load_trials
from smach_oracle.expert.terminal.options import choose, options
from smach_oracle.msg import ExpertQueryGoal, OracleEvent, PointHeadAction
from smach_oracle.srv import AnswerQueryRequest

PRELUDE = """
import sys, rospy, smach, smach_ros
from smach_oracle.msg import PointHeadAction, PointHeadGoal
rospy.init_node('task')
OUTCOMES = ['succeeded', 'aborted', 'preempted']
def look(action, **more):
    return smach_ros.SimpleActionState(action, PointHeadAction,
                                       preempt_timeout=rospy.Duration(2.0), **more)
def machine(label, state):
    sm = smach.StateMachine(outcomes=OUTCOMES)
    with sm:
        smach.StateMachine.add(label, state, {'succeeded': 'succeeded'})
    return sm
"""
ONE_ACTION = (
    PRELUDE
    + """
sm = machine('LOOK', look('look'))
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
)
TWO_ACTIONS = (
    PRELUDE
    + """
both = smach.Concurrence(outcomes=['succeeded', 'aborted'], default_outcome='aborted',
                         outcome_map={'succeeded': {'LEFT': 'succeeded', 'RIGHT': 'succeeded'}})
with both:
    smach.Concurrence.add('LEFT', machine('LOOK_LEFT', look('look')))
    smach.Concurrence.add('RIGHT', machine('LOOK_RIGHT', look('look_right')))
sm = machine('BOTH', both)
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
)
# rospy cannot serialise the first goal
POISONED = (
    PRELUDE
    + """
goals = []
def goal_cb(userdata, goal):
    goals.append(PointHeadGoal())
    if len(goals) == 1:
        goals[0].target = 'no point'
    return goals[-1]
sm = machine('LOOK', look('look', goal_cb=goal_cb))
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
)


class HangingServer:
    """Aborts the first goal, and never answers the next, unless it is cancelled or let go."""

    def __init__(self, name: str) -> None:
        self.begin()
        self._server = actionlib.SimpleActionServer(
            name, PointHeadAction, self._execute, auto_start=False
        )
        self._server.start()

    def begin(self) -> None:
        """As if new."""
        self.goals = 0
        self.go = threading.Event()

    def _execute(self, goal: object) -> None:
        self.goals += 1
        if self.goals == 1:
            self._server.set_aborted()
            return
        while not (
            self.go.wait(0.02) or self._server.is_preempt_requested() or rospy.is_shutdown()
        ):
            pass
        if self.go.is_set():
            self._server.set_succeeded()
        else:
            self._server.set_preempted()


class StillRunningTest(unittest.TestCase):
    servers: List[HangingServer]

    @classmethod
    def setUpClass(cls) -> None:
        cls.servers = [HangingServer(name) for name in ('look', 'look_right')]

    def setUp(self) -> None:
        for server in self.servers:
            server.begin()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.bags = folder.name
        self.expert = FrontEnd(self, '/task/expert_query')

    def start(self, text: str) -> Process:
        settings = {'still_running': {'after_s': 0.5, 'factor': 1}, 'expert': {'deadline_s': 30}}
        config = script(self, json.dumps(settings), 'oracle.yaml')
        return oracle_run(self, '--config', config, '--record', self.bags, script(self, text))

    def question(self, task: Process, state: str = 'LOOK', other_than: str = '') -> Any:
        question = self.expert.question(state=state, other_than=other_than)
        self.assertIsNotNone(question, task.output())
        self.assertEqual(question.query.failure_kind, ExpertQueryGoal.STILL_RUNNING)
        self.assertRegex(
            question.query.text,
            state + r' still runs after .* s; its longest so far '
            r'was .* s\. It has no time limit, so it is not abandoned\.',
        )
        return question

    def answer(self, question: Any, typed: str) -> None:
        decision = choose(typed, options(question.query)).decision()
        decision.by = 'Ann'
        reply = self.expert.answer(AnswerQueryRequest(question.query.query_id, decision))
        self.assertTrue(reply.ok, reply.message)

    def ends(self, task: Process) -> List[OracleEvent]:
        """It succeeds, with its first failure alone; the events of its bag."""
        self.assertTrue(task.says('OUTCOME succeeded', 40.0), task.output())
        self.assertEqual(task.wait(), 0, task.output())
        (events,) = recorded_events(self.bags)
        return events

    def test_a_person_waits_on_and_then_does_it_himself(self) -> None:
        task = self.start(ONE_ACTION)
        first = self.question(task)
        self.answer(first, 'wait on')
        second = self.question(task, other_than=first.query.query_id)
        self.answer(second, 'supersede succeeded')
        events = self.ends(task)
        told = [
            (event.kind, event.query_id)
            for event in events
            if OracleEvent.QUERY_OPENED <= event.kind <= OracleEvent.QUERY_CANCELLED
        ]
        self.assertEqual(
            told,
            [
                (kind, question.query.query_id)
                for question in (first, second)
                for kind in (OracleEvent.QUERY_OPENED, OracleEvent.QUERY_ANSWERED)
            ],
        )
        (trial,) = load_trials([self.bags]).trials
        self.assertEqual(trial.failures_by_state, (('task/LOOK', 1),))
        self.assertEqual((trial.outcome, trial.questions, trial.recoveries), ('succeeded', 2, 1))

    def test_the_question_closes_when_the_server_answers_after_all(self) -> None:
        task = self.start(ONE_ACTION)
        question = self.question(task)
        self.servers[0].go.set()
        events = self.ends(task)
        self.assertEqual(
            [
                event.text
                for event in events
                if event.query_id == question.query.query_id
                and event.kind == OracleEvent.QUERY_CANCELLED
            ],
            ['LOOK has ended'],
        )

    def test_two_states_at_once_have_a_question_each(self) -> None:
        task = self.start(TWO_ACTIONS)
        questions = [self.question(task, state) for state in ('LOOK_LEFT', 'LOOK_RIGHT')]
        for question in questions:
            self.answer(question, 'supersede succeeded')
        events = self.ends(task)
        self.assertEqual(sum(event.kind == OracleEvent.SUPERSEDE for event in events), 2)

    def test_ctrl_c_takes_the_question_back_and_ends_the_program(self) -> None:
        task = self.start(ONE_ACTION)
        question = self.question(task)
        task.signal(signal.SIGINT)
        task.wait()
        (events,) = recorded_events(self.bags)
        self.assertIn(
            (OracleEvent.QUERY_CANCELLED, question.query.query_id),
            [(event.kind, event.query_id) for event in events],
        )

    def test_a_goal_that_cannot_be_sent_keeps_nobody_for_good(self) -> None:
        """Upstream's state waits for an answer to its next goal, which never left."""
        self.servers[0].goals = 1
        self.servers[0].go.set()
        task = self.start(POISONED)
        self.assertTrue(
            wait_for(lambda: 'OUTCOME' in task.output() or self.expert.question(limit_s=0.0)),
            task.output(),
        )
        question = self.expert.question(limit_s=0.0)
        if question is not None:
            self.answer(self.question(task), 'supersede succeeded')
        events = self.ends(task)
        self.assertEqual(
            [event.failure_kind for event in events if event.kind == OracleEvent.FAILURE],
            [OracleEvent.EXCEPTION],
        )


if __name__ == '__main__':
    import rostest

    rospy.init_node('still_running')
    rostest.rosrun('smach_oracle', 'still_running', StillRunningTest, sys.argv)
