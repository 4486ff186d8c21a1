#!/usr/bin/env python3
"""Front ends, servers and askers that die: what becomes of the question."""

import os
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from unittest import mock

import rosbag
import rospy
import rostest
from actionlib_msgs.msg import GoalStatusArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import Asked, Process, make_question
from waiting import stays, wait_for

from smach_oracle.expert import followed_server
from smach_oracle.expert.front_end import FrontEnd, ServerGoneError, wait_for_question
from smach_oracle.msg import (
    ExpertDecision,
    ExpertQueryActionFeedback,
    ExpertQueryActionGoal,
    ExpertQueryActionResult,
    OpenQueries,
    OpenQuery,
)
from smach_oracle.oracle.asking.question import AnswerKind, StateChoice
from smach_oracle.ros.expert.client import ExpertQueryClient

SHARED = '/shared/expert_query'
EXIT_S = 6.0  # in which a node ends after SIGINT; roslaunch would kill it after 15
RULES = """
PICK:
  - {kind: goto, state: DETECT, delay_s: 0.4, why: look again}
  - {kind: supersede, outcome: succeeded, outputs: {grasped: [mug, 1]}}
POUR: {kind: goto, state: POUR}
default: {kind: ignore}
"""


TOPICS = {
    '/goal': ExpertQueryActionGoal,
    '/status': GoalStatusArray,
    '/open': OpenQueries,
    '/feedback': ExpertQueryActionFeedback,
    '/result': ExpertQueryActionResult,
}


class Recording:
    """All that a server's topics say, to be played as a bag."""

    def __init__(self):
        self._heard = []
        self._subscribers = [
            rospy.Subscriber(SHARED + end, kind, self._note, SHARED + end)
            for end, kind in TOPICS.items()
        ]

    def _note(self, message, topic):
        self._heard.append((topic, message, rospy.Time.now()))

    def has(self, end):
        return any(topic.endswith(end) for topic, _, _ in self._heard)

    def write(self, path):
        for subscriber in self._subscribers:
            subscriber.unregister()
        with rosbag.Bag(path, 'w') as bag:
            for topic, message, when in self._heard:
                bag.write(topic, message, when)


def play(path):
    """Play a bag to its end."""
    subprocess.run(
        ['rosbag', 'play', '--quiet', path],
        check=True,
        timeout=60,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )


def goto(state='DETECT'):
    return ExpertDecision(kind=ExpertDecision.GOTO, state=state)


class TestExpertFaults(unittest.TestCase):
    def server(self):
        process = Process.installed('expert_query_server', '__name:=shared', '_asker_gone_s:=1.0')
        self.addCleanup(process.kill)
        return process

    def front_end(self, name='ann', servers=(SHARED,)):
        front_end = FrontEnd(name, servers)
        self.addCleanup(front_end.stop)
        return front_end

    def ask(self, client, **changes):
        asked = Asked(client, make_question(self.id(), **changes))
        self.addCleanup(asked.cancelled.set)
        return asked

    def client(self, server=SHARED):
        client = ExpertQueryClient(server)
        self.addCleanup(client.close)
        return client

    def test_a_front_end_killed_while_it_holds_a_claim_leaves_the_question_to_others(self):
        self.server()
        ann = self.front_end()
        asked = self.ask(self.client())
        holder = Process.role('hold', SHARED)
        self.addCleanup(holder.kill)
        self.assertTrue(wait_for(lambda: any(each.holder == 'holder' for each in ann.questions())))
        (listed,) = ann.questions()
        self.assertEqual(listed.status, OpenQuery.CLAIMED)
        self.assertTrue(
            stays(lambda: ann.questions()[0].holder == 'holder', 2.0),
            'it renews its claim of 1.5 s',
        )
        self.assertIn('holder works on this question', ann.answer(listed, goto()).message)
        holder.kill()
        self.assertTrue(wait_for(lambda: ann.questions()[0].status == OpenQuery.PENDING))
        # feedback has a topic of its own, and may come behind the result
        self.assertTrue(
            wait_for(
                lambda: (
                    [what[:2] for what in asked.progress]
                    == [('claimed', 'holder'), ('released', 'holder')]
                )
            )
        )
        self.assertTrue(ann.answer(listed, goto()).ok)
        self.assertTrue(asked.wait())

    def test_a_server_killed_and_restarted_is_asked_again(self):
        first = self.server()
        ann = self.front_end()
        asked = self.ask(self.client(), deadline_s=60.0)
        self.assertIsNotNone(wait_for_question(ann, 40.0))
        first.kill()
        self.assertTrue(wait_for(lambda: not ann.connected(SHARED)))
        self.assertEqual(ann.questions(), [])
        self.assertFalse(asked.wait(0.5), 'the question waits for the server to come back')
        self.server()
        listed = wait_for_question(ann, 40.0)
        self.assertEqual(listed.goal.query_id, self.id())
        self.assertLess(
            listed.deadline_s - time.monotonic(), 59.0, 'the deadline does not begin again'
        )
        self.assertTrue(ann.answer(listed, goto('PICK')).ok)
        self.assertTrue(asked.wait())
        self.assertEqual(asked.answer.state, 'PICK')

    def test_a_played_bag_neither_asks_nor_hides_a_question_nor_takes_it_back(self):
        server = self.server()
        ann = self.front_end()
        client = self.client()
        recording = Recording()
        self.addCleanup(client.close)
        past = Asked(client, make_question('past'))
        listed = wait_for_question(ann, 40.0)
        # a claim, so that all topics have something, and the list as it comes again each second
        self.assertTrue(ann.claim(listed).ok)
        self.assertTrue(wait_for(lambda: recording.has('/feedback')))
        self.assertTrue(ann.answer(listed, goto()).ok)
        self.assertTrue(past.wait())
        self.assertTrue(wait_for(lambda: recording.has('/result')))
        with tempfile.TemporaryDirectory() as folder:
            bag = os.path.join(folder, 'past.bag')
            recording.write(bag)
            asked = self.ask(client)
            self.assertIsNotNone(wait_for_question(ann, 40.0))
            seen = set()
            front_ends = [ann, self.front_end('joe', ())]  # one that finds servers by itself
            self.assertTrue(wait_for(lambda: front_ends[1].questions()))
            playing = threading.Thread(target=play, args=(bag,))
            playing.start()
            while playing.is_alive():
                seen.update(
                    tuple(each.goal.query_id for each in front_end.questions())
                    for front_end in front_ends
                )
                playing.join(0.01)
            self.assertEqual(seen, {(self.id(),)})
            self.assertEqual(asked.progress, [], 'its server was there all the time')
            self.assertTrue(ann.answer(ann.questions()[0], goto('PICK')).ok)
            self.assertTrue(asked.wait())
            server.interrupt()
            self.assertTrue(wait_for(lambda: not ann.connected(SHARED)))
            playing = threading.Thread(target=play, args=(bag,))
            playing.start()
            while playing.is_alive():
                self.assertEqual([front_end.questions() for front_end in front_ends], [[], []])
                playing.join(0.01)

    def test_with_no_server_at_all_the_deadline_still_holds(self):
        client = self.client('/nowhere/expert_query')
        begun_s = time.monotonic()
        asked = self.ask(client, deadline_s=0.5)
        self.assertTrue(asked.wait())
        self.assertIsNone(asked.answer)
        self.assertGreater(asked.returned_s - begun_s, 0.45)
        taken_back = Asked(client, make_question('taken back'))
        self.assertFalse(taken_back.wait(0.2))
        taken_back.cancelled.set()
        self.assertTrue(taken_back.wait())

    def test_a_question_whose_server_dies_for_good_ends_by_its_deadline(self):
        server = self.server()
        ann = self.front_end()
        # so that the deadline is not spent on its start
        self.assertTrue(wait_for(lambda: ann.connected(SHARED)))
        asked = self.ask(self.client(), deadline_s=4.0)
        self.assertIsNotNone(wait_for_question(ann, 40.0))
        server.kill()
        self.assertTrue(asked.wait())
        self.assertIsNone(asked.answer)
        with self.assertRaisesRegex(
            ServerGoneError, '/shared/expert_query/answer cannot be reached'
        ):
            ann._servers[SHARED].answer('q', goto())

    def test_a_server_that_hangs_holds_no_front_end_up(self):
        server = self.server()
        ann = self.front_end()
        asked = self.ask(self.client())
        listed = wait_for_question(ann, 40.0)
        self.assertTrue(ann.claim(listed).ok)
        server.freeze()
        with mock.patch.object(followed_server, 'CALL_LIMIT_S', 1.0):
            with self.assertRaisesRegex(
                ServerGoneError, '/shared/expert_query/answer does not answer'
            ):
                ann.answer(listed, goto())
        begun_s = time.monotonic()
        with self.assertRaisesRegex(ServerGoneError, 'does not answer'):
            ann.answer(listed, goto('PICK'))
        ann.stop()
        self.assertLess(time.monotonic() - begun_s, 4.0)
        server.thaw()
        self.assertTrue(asked.wait(), 'the answer that hung arrives after all')
        self.assertEqual(asked.answer.state, 'DETECT')

    def test_a_scripted_expert_whose_server_hangs_ends_quickly_on_ctrl_c(self):
        with tempfile.NamedTemporaryFile('w', suffix='.yaml') as rules:
            rules.write('default: {kind: give_up, delay_s: 3.0}')
            rules.flush()
            server = self.server()
            expert = Process.installed('scripted_expert', '_rules_file:=' + rules.name)
            self.addCleanup(expert.kill)
            ann = self.front_end()
            self.ask(self.client())
            self.assertTrue(wait_for(lambda: any(each.holder for each in ann.questions())))
        server.freeze()
        time.sleep(0.5)  # for a call of the expert's to hang, which nobody can see
        self.assertLess(expert.interrupt(), EXIT_S)

    def test_the_question_of_a_killed_robot_is_closed(self):
        self.server()
        ann = self.front_end()
        asker = Process.role('ask', SHARED, self.id())
        self.addCleanup(asker.kill)
        listed = wait_for_question(ann, 40.0)
        self.assertIsNotNone(listed)
        self.assertTrue(
            stays(lambda: ann.find(listed.key), 2.0), 'it stays open as long as the robot is there'
        )
        asker.kill()
        self.assertTrue(wait_for(lambda: ann.connected(SHARED) and ann.find(listed.key) is None))
        response = ann.answer(listed, goto())
        self.assertFalse(response.ok)
        self.assertIn('the asker is gone', response.message)

    def test_a_server_with_an_open_question_ends_quickly_on_ctrl_c(self):
        server = self.server()
        ann = self.front_end()
        self.ask(self.client())
        self.assertIsNotNone(wait_for_question(ann, 40.0))
        self.assertLess(server.interrupt(), EXIT_S)

    def test_a_robot_that_waits_for_an_answer_ends_quickly_on_ctrl_c(self):
        self.server()
        ann = self.front_end()
        asker = Process.role('ask', SHARED, self.id())
        self.addCleanup(asker.kill)
        self.assertIsNotNone(wait_for_question(ann, 40.0))
        self.assertLess(asker.interrupt(), EXIT_S)

    def test_a_scripted_expert_answers_by_its_rules(self):
        with tempfile.NamedTemporaryFile('w', suffix='.yaml') as rules:
            rules.write(RULES)
            rules.flush()
            expert = Process.installed('scripted_expert', '_rules_file:=' + rules.name)
            self.addCleanup(expert.kill)
            client = self.client('')  # a server of our own
            first = self.ask(client)
            self.assertTrue(first.wait())
        self.assertEqual(
            (first.answer.state, first.answer.by, first.answer.why),
            ('DETECT', 'scripted_expert', 'look again'),
        )
        self.assertEqual(first.progress, [('claimed', 'scripted_expert', 'claimed')])
        second = Asked(client, make_question('second'))
        self.assertTrue(second.wait())
        self.assertEqual(
            (second.answer.kind, second.answer.outputs),
            (AnswerKind.SUPERSEDE, {'grasped': ['mug', 1]}),
        )
        ignored = Asked(client, make_question('third', failed_state='PLACE', deadline_s=1.0))
        self.assertTrue(ignored.wait())
        self.assertIsNone(ignored.answer)
        poured = StateChoice('POUR', 0.9, 1, 1, (), (), repeats=('POUR',))
        unconfirmed = Asked(
            client, make_question('fourth', failed_state='POUR', deadline_s=1.0, choices=(poured,))
        )
        self.assertTrue(unconfirmed.wait())
        self.assertIsNone(unconfirmed.answer, 'the rule does not confirm that it is repeated')
        self.assertLess(expert.interrupt(), EXIT_S)


if __name__ == '__main__':
    rospy.init_node('expert_faults')
    rostest.rosrun('smach_oracle', 'expert_faults', TestExpertFaults)
