#!/usr/bin/env python3
"""Questions and answers between an executive, its server and several experts, on a real master."""

import os
import subprocess
import sys
import threading
import time
import unittest

import roslib.packages
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import Asked, make_question
from waiting import stays, wait_for

from smach_oracle.expert.front_end import FrontEnd
from smach_oracle.msg import ExpertDecision, UserdataItem
from smach_oracle.oracle.asking.question import AnswerKind
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.ros.expert.client import ExpertQueryClient
from smach_oracle.ros.userdata_codec import encode

SERVER = '/expert_protocol/expert_query'


def goto(state='DETECT'):
    return ExpertDecision(kind=ExpertDecision.GOTO, state=state, why='seen on the camera')


def supersede(*outputs):
    return ExpertDecision(kind=ExpertDecision.SUPERSEDE, outcome='succeeded', outputs=list(outputs))


class TestExpertProtocol(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.client = ExpertQueryClient()
        cls.ann = FrontEnd('ann', [SERVER])
        cls.bob = FrontEnd('bob')  # discovers the server by itself

    def ask(self, **changes):
        """A question, asked and listed."""
        asked = Asked(self.client, make_question(self.id(), **changes))
        self.addCleanup(asked.cancelled.set)
        listed = wait_for(lambda: self.listed(self.ann))
        self.assertIsNotNone(listed, 'the question is in the open list')
        return asked, listed

    def listed(self, front_end, query_id=None):
        return next(
            (
                each
                for each in front_end.questions()
                if each.goal.query_id == (query_id or self.id())
            ),
            None,
        )

    def test_an_answer_resumes_the_robot(self):
        asked, listed = self.ask(userdata={'object': 'mug', 'image': object()})
        self.assertEqual(listed.goal.robot, '/expert_protocol')
        self.assertEqual(
            {item.key: item.encoding for item in listed.goal.userdata},
            {'object': UserdataItem.JSON, 'image': UserdataItem.UNSENT},
        )
        self.assertTrue(self.ann.answer(listed, goto()).ok)
        self.assertTrue(asked.wait())
        self.assertEqual(
            asked.answer, (AnswerKind.GOTO, 'DETECT', '', '', None, 'ann', 'seen on the camera', '')
        )
        self.assertTrue(wait_for(lambda: self.listed(self.ann) is None), 'it leaves the open list')

    def test_superseding_hands_over_the_output_userdata(self):
        asked, listed = self.ask()
        self.ann.answer(listed, supersede(encode('grasped', {'name': 'mug', 'grip': 0.02})))
        self.assertTrue(asked.wait())
        self.assertEqual(asked.answer.outputs, {'grasped': {'name': 'mug', 'grip': 0.02}})

    def test_outputs_of_an_unknown_message_type_are_an_answer_error(self):
        asked, listed = self.ask()
        self.ann.answer(
            listed,
            supersede(
                UserdataItem('grasped', UserdataItem.ROS_MESSAGE, 'no_such/Grasp', '0' * 32, b'')
            ),
        )
        self.assertTrue(asked.wait())
        self.assertIsInstance(asked.error, AnswerError)
        self.assertIn('no_such/Grasp is not installed here', str(asked.error))

    def test_an_answer_naming_an_unknown_state_leaves_the_question_open(self):
        asked, listed = self.ask()
        response = self.ann.answer(listed, goto('NOWHERE'))
        self.assertFalse(response.ok)
        self.assertIn("no state 'NOWHERE' to go to; allowed: DETECT, PICK", response.message)
        self.assertFalse(asked.wait(0.3))
        self.assertTrue(self.ann.answer(listed, goto()).ok)
        self.assertTrue(asked.wait())

    def test_of_two_experts_answering_at_once_one_wins_and_the_other_is_told(self):
        asked, listed = self.ask()
        start = threading.Barrier(2)
        responses = {}

        def answer(front_end, decision):
            start.wait()
            responses[front_end.expert] = front_end.answer(listed, decision)

        self.assertTrue(wait_for(lambda: self.listed(self.bob)), 'bob has discovered the server')
        threads = [
            threading.Thread(target=answer, args=arguments)
            for arguments in ((self.ann, goto('DETECT')), (self.bob, goto('PICK')))
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30.0)
        self.assertTrue(asked.wait())
        (winner,) = [name for name, response in responses.items() if response.ok]
        (loser,) = [name for name, response in responses.items() if not response.ok]
        self.assertEqual(asked.answer.by, winner)
        self.assertIn('{} was first'.format(winner), responses[loser].message)
        self.assertEqual(responses[loser].settled.by, winner)

    def test_the_robot_is_told_who_works_on_its_question(self):
        asked, listed = self.ask()
        self.assertTrue(self.ann.claim(listed).ok)
        self.assertFalse(self.bob_claims(listed).ok)
        self.assertEqual(self.listed(self.ann).holder, 'ann')
        self.ann.release(listed)
        self.assertTrue(self.bob_claims(listed).ok)
        self.assertTrue(self.ann.claim(listed, take_over=True).ok)
        self.assertTrue(self.ann.answer(listed, goto()).ok)
        self.assertTrue(asked.wait())
        self.assertEqual(
            asked.progress,
            [
                ('claimed', 'ann', 'claimed'),
                ('released', 'ann', 'ann gave it back'),
                ('claimed', 'bob', 'claimed'),
                ('claimed', 'ann', 'taken over from bob'),
            ],
        )

    def bob_claims(self, listed):
        self.assertTrue(wait_for(lambda: self.bob.find(listed.key)))
        return self.bob.claim(listed)

    def test_a_claim_stays_alive_while_a_person_thinks(self):
        lease_s = 2.0
        slow = FrontEnd('slow', [SERVER], lease_s=lease_s)
        self.addCleanup(slow.stop)
        _, listed = self.ask()
        self.assertTrue(wait_for(lambda: slow.find(listed.key)))
        self.assertTrue(slow.claim(listed).ok)
        self.assertTrue(wait_for(lambda: self.listed(self.ann).holder == 'slow'))  # by its topic
        self.assertTrue(stays(lambda: self.listed(self.ann).holder == 'slow', 2.0 * lease_s))

    def test_nobody_answers_by_the_deadline(self):
        begun_s = time.monotonic()
        asked, listed = self.ask(deadline_s=0.8)
        self.assertTrue(asked.wait())
        self.assertIsNone(asked.answer)
        self.assertGreater(asked.returned_s - begun_s, 0.75)
        response = self.ann.answer(listed, goto())
        self.assertFalse(response.ok)
        self.assertIn('nobody answered by the deadline', response.message)

    def test_a_question_taken_back_returns_at_once_and_is_closed(self):
        asked, listed = self.ask()
        begun_s = time.monotonic()
        asked.cancelled.set()
        self.assertTrue(asked.wait())
        self.assertIsNone(asked.answer)
        self.assertLess(asked.returned_s - begun_s, 2.0)
        self.assertTrue(wait_for(lambda: self.listed(self.ann) is None))
        self.assertIn('taken back by the asker', self.ann.answer(listed, goto()).message)

    def test_questions_wait_side_by_side(self):
        both = [Asked(self.client, make_question(self.id() + end)) for end in '12']
        for asked in both:
            self.addCleanup(asked.cancelled.set)
        self.assertTrue(wait_for(lambda: len(self.ann.questions()) == 2))
        self.ann.answer(self.listed(self.ann, self.id() + '2'), goto('PICK'))
        self.assertTrue(both[1].wait())
        self.assertFalse(both[0].wait(0.2))
        self.ann.answer(self.listed(self.ann, self.id() + '1'), goto('DETECT'))
        self.assertTrue(both[0].wait())
        self.assertEqual([asked.answer.state for asked in both], ['DETECT', 'PICK'])

    def test_the_same_question_asked_again_joins_the_open_one(self):
        first, listed = self.ask()
        second = Asked(self.client, make_question(self.id()))
        self.assertTrue(stays(lambda: len(self.ann.questions()) == 1, 0.5))
        self.ann.answer(listed, goto())
        self.assertTrue(first.wait() and second.wait())
        self.assertEqual(first.answer, second.answer)
        late = Asked(self.client, make_question(self.id()))
        self.assertTrue(late.wait())
        self.assertEqual(late.answer, first.answer)

    def test_the_open_list_is_published_while_a_question_waits(self):
        self.ask()
        version = self.ann.wait_for_change(-1, 0.0)
        for _ in range(2):
            before, version = version, self.ann.wait_for_change(version, 30.0)
            self.assertGreater(version, before)

    def test_the_front_end_of_the_documentation_answers(self):
        with open(
            os.path.join(roslib.packages.get_pkg_dir('smach_oracle'), 'doc', 'expert.md')
        ) as page:
            code = page.read().split('## A front end in')[1].split('```python\n')[1].split('```')[0]
        self.assertLessEqual(len(code.splitlines()), 20)
        asked, _ = self.ask()
        process = subprocess.Popen([sys.executable, '-c', code], stdin=subprocess.PIPE)
        self.addCleanup(process.wait, 10.0)
        self.addCleanup(process.kill)
        process.stdin.write(b'DETECT\n')
        process.stdin.close()
        self.assertTrue(asked.wait(60.0))
        self.assertEqual((asked.answer.state, asked.answer.by), ('DETECT', 'ann'))

    def test_a_front_end_that_starts_late_sees_the_open_questions(self):
        _, listed = self.ask()
        late = FrontEnd('late')
        self.addCleanup(late.stop)
        # the list that is latched may be of before, with what was open then
        self.assertTrue(wait_for(lambda: [each.key for each in late.questions()] == [listed.key]))


if __name__ == '__main__':
    rospy.init_node('expert_protocol')
    rostest.rosrun('smach_oracle', 'expert_protocol', TestExpertProtocol)
