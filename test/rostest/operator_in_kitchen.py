#!/usr/bin/env python3
"""The scripted operator in the simulated kitchen: it takes the drink and hands it over by hand, or
sends to a state.
"""

import os
import sys
import threading
import unittest

import rospy

import smach

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import Asked, make_question

from smach_oracle.oracle.asking.question import AnswerKind, OutcomeChoice, StateChoice
from smach_oracle.oracle.settings.interfaces import InterfaceOffer
from smach_oracle.ros.expert.client import ExpertQueryClient
from smach_oracle.srv import Judge, ResetWorld, Reveal
from smach_oracle.tasks import drink_retrieval

OFFERS = (
    InterfaceOffer('perception', '/perception_interface'),
    InterfaceOffer('manipulation', '/manipulation_interface'),
)


class InKitchen(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service('world/reset', 60.0)
        cls.client = ExpertQueryClient(server_wait_s=30.0)
        cls.states = drink_retrieval.make_machine().get_children()

    def run_state(self, label):
        userdata = smach.UserData()
        drink_retrieval.begin(userdata)
        self.assertEqual(self.states[label].execute(userdata), 'succeeded', label)

    def ask(self, state, outputs=()):
        """Ask about a state; the question and its answer."""
        question = make_question(
            'q-{}-{}'.format(state, rospy.get_time()),
            failed_state=state,
            interfaces=OFFERS,
            output_keys=tuple(outputs),
            userdata={},
            input_userdata={},
            choices=tuple(StateChoice(label, 0.1, 1, 1, (), ()) for label in self.states),
            supersede_outcomes=(OutcomeChoice('succeeded', 'NEXT'),),
        )
        asked = Asked(self.client, question)
        self.assertTrue(asked.wait(60.0), 'nobody answered')
        return question, asked.answer

    def by_hand(self, state, outputs=()):
        question, answer = self.ask(state, outputs)
        self.assertEqual(answer.kind, AnswerKind.INTERFACE, answer)
        offer = next(each for each in OFFERS if each.name == answer.interface)
        done = self.client.run_interface(offer, question, threading.Event(), lambda *_: None)
        self.assertIsNotNone(done, state + ' did not work by hand')
        self.assertEqual(done.outcome, 'succeeded')

    def test_the_drink_is_taken_and_handed_over_by_hand(self):
        self.assertTrue(rospy.ServiceProxy('world/reset', ResetWorld)(3).ok)
        for label in ('RAISE_TORSO', 'OPEN_FRIDGE', 'MOVE_IN'):
            self.run_state(label)
        self.by_hand('PICK_DRINK', ('grasp',))
        held = [
            body.name
            for body in rospy.ServiceProxy('world/reveal', Reveal)([]).bodies
            if body.held == 'right'
        ]
        self.assertEqual(len(held), 1)
        for label in ('MOVE_OUT', 'MOVE_HOME'):
            self.run_state(label)
        self.by_hand('HAND_OVER')
        verdict = rospy.ServiceProxy('world/judge', Judge)()
        self.assertTrue(verdict.success, verdict.why)

    def test_where_nothing_can_be_driven_it_sends_the_machine_to_a_state(self):
        answers = [self.ask('CLOSE_FRIDGE')[1] for _ in range(2)]
        self.assertEqual(
            [(answer.kind, answer.state) for answer in answers],
            [(AnswerKind.GOTO, 'MOVE_OUT'), (AnswerKind.GOTO, 'CLOSE_FRIDGE')],
        )


if __name__ == '__main__':
    import rostest

    rospy.init_node('operator_in_kitchen')
    rostest.rosrun('smach_oracle', 'operator_in_kitchen', InKitchen)
