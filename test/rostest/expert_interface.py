#!/usr/bin/env python3
"""Shared-autonomy interfaces that an expert starts: seen to run, superseding the state, failing,
preempted.
"""

import os
import sys
import threading
import time
import unittest

import actionlib
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import Asked, Process, make_question
from waiting import wait_for

from smach_oracle.expert.front_end import FrontEnd
from smach_oracle.msg import (
    ExpertDecision,
    OpenQuery,
    SharedAutonomyAction,
    SharedAutonomyFeedback,
    SharedAutonomyResult,
    UserdataItem,
)
from smach_oracle.oracle.asking.answer_rules import check_answer, choices_of
from smach_oracle.oracle.asking.question import AnswerKind, InterfaceOffer
from smach_oracle.oracle.errors import AnswerError, InterfaceError
from smach_oracle.ros.expert.client import ExpertQueryClient
from smach_oracle.ros.userdata_codec import decode_all, encode_all

SERVER = '/expert_interface/expert_query'
SHARED = '/shared/expert_query'  # a node of its own


class FakeInterface:
    """A shared-autonomy interface whose person does what the test says."""

    def __init__(self, work):
        self._server = actionlib.SimpleActionServer(
            '/assist', SharedAutonomyAction, self._execute, auto_start=False
        )
        self._work = work
        self.goals = []
        self._server.start()

    def _execute(self, goal):
        self.goals.append(goal)
        self._server.publish_feedback(SharedAutonomyFeedback(0.5, 'half done'))
        self._work(self._server)

    def stop(self):
        self._server.action_server.stop()


class TestInterfaces(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.client = ExpertQueryClient(server_wait_s=20.0)
        cls.ann = FrontEnd('ann')
        cls.offer = InterfaceOffer('assist', '/assist')

    def setUp(self):
        self.cancelled = threading.Event()
        self.told = []
        self.question = make_question(self.id())

    def interface(self, work):
        interface = FakeInterface(work)
        self.addCleanup(interface.stop)
        return interface

    def run_interface(self, client=None):
        return (client or self.client).run_interface(
            self.offer, self.question, self.cancelled, lambda *what: self.told.append(what)
        )

    def why_not_taken(self):
        """Why the oracle does not take the answer of the interface, as the expert is told."""
        with self.assertRaises(AnswerError) as raised:
            check_answer(self.run_interface(), choices_of(self.question))
        return str(raised.exception)

    def listed(self):
        """This test's question: that of the test before may not have left the list yet."""
        return [each for each in self.ann.questions() if each.goal.query_id == self.id()]

    def statuses(self):
        return [(each.status, each.holder) for each in self.listed()]

    def test_an_interface_does_the_state_s_work_and_is_seen_to_run(self):
        seen = []

        def work(server):
            seen.append(wait_for(self.statuses))
            server.set_succeeded(
                SharedAutonomyResult('succeeded', encode_all({'grasped': 'mug'}), 'by hand')
            )

        interface = self.interface(work)
        asked = Asked(self.client, self.question)
        (listed,) = wait_for(self.listed)
        self.assertTrue(
            self.ann.answer(
                listed, ExpertDecision(kind=ExpertDecision.INTERFACE, interface='assist')
            ).ok
        )
        self.assertTrue(asked.wait())
        self.assertEqual(
            (asked.answer.kind, asked.answer.interface), (AnswerKind.INTERFACE, 'assist')
        )
        self.assertTrue(wait_for(lambda: not self.statuses()))
        answer = self.run_interface()
        self.assertEqual(
            (answer.kind, answer.outcome, answer.outputs),
            (AnswerKind.SUPERSEDE, 'succeeded', {'grasped': 'mug'}),
        )
        (goal,) = interface.goals
        self.assertEqual(
            (goal.state, goal.outcomes, decode_all(goal.userdata)),
            ('PICK', ['succeeded', 'aborted'], {'target': 'mug'}),
        )
        self.assertEqual(seen, [[(OpenQuery.INTERFACE_RUNNING, 'ann')]])
        self.assertEqual(
            self.told, [('interface_start', 'assist', ''), ('interface_end', 'assist', 'succeeded')]
        )
        self.assertTrue(
            wait_for(lambda: not self.statuses()), 'it leaves the list when the interface ends'
        )

    def shared_server(self):
        server = Process.installed('expert_query_server', '__name:=shared')
        self.addCleanup(server.kill)
        return server

    def test_an_interface_is_seen_to_run_also_by_a_server_that_comes_later_or_again(self):
        client = ExpertQueryClient(SHARED)
        self.addCleanup(client.close)
        done = threading.Event()

        def work(server):
            done.wait(60.0)
            server.set_succeeded(SharedAutonomyResult('succeeded', [], ''))

        self.interface(work)
        person = threading.Thread(target=self.run_interface, args=(client,), daemon=True)
        person.start()
        self.addCleanup(done.set)
        for _ in range(2):
            server = self.shared_server()
            self.assertTrue(
                wait_for(lambda: self.statuses() == [(OpenQuery.INTERFACE_RUNNING, '')]),
                'nobody sees that the robot waits for its interface',
            )
            server.kill()
            self.assertTrue(wait_for(lambda: not self.statuses()))
        self.shared_server()
        self.assertTrue(wait_for(self.statuses))
        done.set()
        person.join(20.0)
        self.assertTrue(wait_for(lambda: not self.statuses()), 'it has left the list')

    def test_an_interface_that_is_not_there_is_waited_for_only_so_long(self):
        impatient = ExpertQueryClient(SERVER, server_wait_s=2.0)
        self.addCleanup(impatient.close)
        begun_s = time.monotonic()
        with self.assertRaises(InterfaceError):
            self.run_interface(impatient)
        self.assertTrue(1.9 < time.monotonic() - begun_s < 12.0)
        self.assertEqual(self.told[-1], ('interface_end', 'assist', ''))

    def test_an_interface_that_fails_or_answers_nonsense_supersedes_nothing(self):
        results = [
            ('aborted', SharedAutonomyResult('succeeded', [], 'the arm is stuck')),
            ('succeeded', SharedAutonomyResult('finished', [], '')),
            ('succeeded', SharedAutonomyResult('succeeded', encode_all({'other': 1}), '')),
            (
                'succeeded',
                SharedAutonomyResult('succeeded', [UserdataItem('grasped', 1, '', '', b'{')], ''),
            ),
        ]
        self.interface(lambda server: getattr(server, 'set_' + results[0][0])(results.pop(0)[1]))
        for why in ('failed: the arm is stuck', 'finished', 'other', 'grasped'):
            self.assertIn(why, self.why_not_taken())
        self.assertEqual(results, [])

    def test_an_interface_that_refuses_says_why(self):
        server = actionlib.ActionServer(
            '/assist',
            SharedAutonomyAction,
            lambda handle: handle.set_rejected(SharedAutonomyResult(), 'busy with DETECT'),
            auto_start=False,
        )
        self.addCleanup(server.stop)
        server.start()
        with self.assertRaisesRegex(InterfaceError, '^refused it: busy with DETECT$'):
            self.run_interface()

    def test_a_preempt_stops_the_interface_at_once(self):
        preempted = threading.Event()

        def work(server):
            self.cancelled.set()
            if wait_for(server.is_preempt_requested):
                preempted.set()
            server.set_preempted()

        self.interface(work)
        begun_s = time.monotonic()
        self.assertIsNone(self.run_interface())
        self.assertLess(time.monotonic() - begun_s, 8.0)
        self.assertTrue(preempted.wait(30.0), 'the interface was told')


if __name__ == '__main__':
    rospy.init_node('expert_interface')
    rostest.rosrun('smach_oracle', 'expert_interface', TestInterfaces)
