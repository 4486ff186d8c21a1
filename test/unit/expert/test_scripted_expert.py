"""The scripted expert beside others: its server is restarted, ann works on its question, the clock
jumps; no master.
"""

import pytest
import rospy
from expert_fixtures import make_question

from smach_oracle.expert import scripted_expert as module
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.expert.rules import Rules
from smach_oracle.expert.scripted_expert import ScriptedExpert
from smach_oracle.msg import ExpertDecision
from smach_oracle.ros.expert.open_questions import REMEMBERED, OpenQuestions
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.srv import ClaimQueryRequest

SERVER = '/shared/expert_query'
LEASE_S = 4.0
FIRST = {'kind': 'goto', 'state': 'DETECT', 'delay_s': 8.0, 'why': 'first rule'}
SECOND = {'kind': 'give_up', 'why': 'second rule'}
TWO_RULES = {'PICK': [FIRST, SECOND]}


class Clock:
    now_s = 1000.0


class FrontEnd:
    """A front end whose server is here, and has a real list of open questions."""

    expert = 'scripted'

    def __init__(self):
        self.restart()

    def restart(self):
        """The server comes back and knows nothing."""
        self.server = OpenQuestions(LEASE_S, clock=lambda: Clock.now_s)

    def ask(self, query_id):
        self.server.open(to_goal(make_question(query_id), '/robot', asked=rospy.Time(1)))

    def claim_of(self, expert, action=ClaimQueryRequest.CLAIM, query_id='q1'):
        return self.server.claim(action, query_id, expert)

    def questions(self):
        return [
            ListedQuestion(SERVER, each.query, each.status, each.claimed_by, 0.0, float('inf'))
            for each in self.server.listing()
        ]

    def claim(self, listed):
        return self.server.claim(ClaimQueryRequest.CLAIM, listed.goal.query_id, self.expert, 3600.0)

    def release(self, listed):
        self.server.claim(ClaimQueryRequest.RELEASE, listed.goal.query_id, self.expert)

    def answer(self, listed, decision):
        decision.by = self.expert
        return self.server.answer(listed.goal.query_id, decision)

    def answers(self):
        """Why each question was settled as it was."""
        return [each.decision.why for each in self.server._settled.values()]


@pytest.fixture(name='front_end')
def make_front_end(monkeypatch):
    """Nothing looks by itself, and only the test has time pass."""
    monkeypatch.setattr(ScriptedExpert, '_run', lambda self: None)
    monkeypatch.setattr(module.time, 'monotonic', lambda: Clock.now_s)
    monkeypatch.setattr(module.rospy, 'get_time', lambda: Clock.now_s)
    monkeypatch.setattr(Clock, 'now_s', 1000.0)
    return FrontEnd()


def look_after(expert, seconds):
    """Let it look ten times a second for a while."""
    for _ in range(round(seconds * 10)):
        Clock.now_s += 0.1
        expert.look()


def test_a_question_that_its_restarted_server_asks_again_keeps_its_rule(front_end):
    expert = ScriptedExpert(front_end, Rules.parse(TWO_RULES))
    front_end.ask('q1')
    look_after(expert, 2.0)
    front_end.restart()
    look_after(expert, 1.0)
    front_end.ask('q1')
    look_after(expert, 9.0)
    assert front_end.answers() == ['first rule']
    front_end.ask('q2')
    look_after(expert, 1.0)
    assert front_end.answers() == ['first rule', 'second rule']


def test_rules_of_old_questions_are_forgotten(front_end):
    expert = ScriptedExpert(front_end, Rules.parse({'default': SECOND}))
    for number in range(REMEMBERED + 5):
        front_end.ask('q{}'.format(number))
        expert.look()
    assert len(expert._chosen) == REMEMBERED
    assert len(expert._planned) <= 1, 'the others are settled'


def test_a_question_that_ann_took_over_is_answered_once_her_claim_has_run_out(front_end):
    expert = ScriptedExpert(front_end, Rules.parse(TWO_RULES))
    front_end.ask('q1')
    look_after(expert, 2.0)
    assert front_end.questions()[0].holder == 'scripted'
    assert front_end.claim_of('ann', ClaimQueryRequest.TAKE_OVER).ok
    look_after(expert, LEASE_S - 0.5)
    assert front_end.questions()[0].holder == 'ann'
    look_after(expert, 1.0)
    assert front_end.questions()[0].holder == 'scripted', 'free again'
    look_after(expert, 8.0)
    assert front_end.answers() == ['first rule']


@pytest.mark.parametrize('delay_s', [0.0, 1.0])
def test_so_is_one_that_ann_claimed_before_its_list_said_so(front_end, delay_s):
    expert = ScriptedExpert(front_end, Rules.parse({'PICK': dict(FIRST, delay_s=delay_s)}))
    front_end.ask('q1')
    old = front_end.questions()
    front_end.claim_of('ann')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(front_end, 'questions', lambda: old)
        look_after(expert, 0.1)
    assert front_end.questions()[0].holder == 'ann'
    look_after(expert, 0.1)
    front_end.claim_of('ann', ClaimQueryRequest.RELEASE)
    look_after(expert, 0.1)
    assert not delay_s or front_end.questions()[0].holder == 'scripted'
    look_after(expert, delay_s + 0.1)
    assert front_end.answers() == ['first rule']


def test_ann_s_answer_stands_and_leaves_the_second_rule_to_the_next_question(front_end):
    expert = ScriptedExpert(front_end, Rules.parse(TWO_RULES))
    front_end.ask('q1')
    look_after(expert, 1.0)
    front_end.claim_of('ann', ClaimQueryRequest.TAKE_OVER)
    look_after(expert, 1.0)
    front_end.server.answer('q1', ExpertDecision(kind=ExpertDecision.GIVE_UP, by='ann', why='hers'))
    look_after(expert, 10.0)
    front_end.ask('q2')
    look_after(expert, 1.0)
    assert front_end.answers() == ['hers', 'second rule']


def test_an_answer_that_does_not_fit_is_given_once(front_end):
    given = []
    answer = front_end.answer
    front_end.answer = lambda *what: given.append(what) or answer(*what)
    expert = ScriptedExpert(front_end, Rules.parse({'PICK': {'kind': 'goto', 'state': 'NOWHERE'}}))
    front_end.ask('q1')
    look_after(expert, 5.0)
    assert len(given) == 1 and front_end.answers() == []


@pytest.mark.parametrize('jumped_to_s', [0.0, 998.0])
def test_a_clock_that_jumps_back_delays_an_answer_no_longer_than_its_delay(front_end, jumped_to_s):
    expert = ScriptedExpert(front_end, Rules.parse({'PICK': FIRST}), answer_delay_s=6.0)
    front_end.ask('q1')
    look_after(expert, 4.0)
    Clock.now_s = jumped_to_s
    look_after(expert, 5.5)
    assert front_end.answers() == [], 'the delay begins again'
    look_after(expert, 1.0)
    assert front_end.answers() == ['first rule']
