"""A claim belongs to one browser: another one of the same name neither shares it nor answers by
it.
"""

import pytest
import rospy
from expert_fixtures import make_question

from smach_oracle.expert.claims import Claim, ClaimKeeper
from smach_oracle.expert.console.answering import session_claims
from smach_oracle.expert.console.answering.question_commands import QuestionCommands
from smach_oracle.expert.console.answering.session_claims import CLAIM_FIRST
from smach_oracle.expert.console.commands.commands import PageCommand
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import ExpertQueryGoal
from smach_oracle.ros.expert.open_questions import OpenQuestions
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.srv import AnswerQueryResponse, ClaimQueryRequest, ClaimQueryResponse

DESK = Person('10.0.0.7', 'desk', 'operator', 'ann')
PHONE = Person('10.0.0.8', 'phone', 'operator', 'ann')
BOB = Person('10.0.0.9', 'bobs', 'operator', 'bob')


class Robot:
    """A front end at the open questions of one robot, as its server keeps them."""

    def __init__(self):
        self.questions = OpenQuestions()
        goal = to_goal(make_question('q'), '/robot', asked=rospy.Time(1))
        self.questions.open(goal)
        self.key = self.listed().key

    def listed(self):
        found = self.questions.listing()
        return (
            ListedQuestion(
                '/server', found[0].query, found[0].status, found[0].claimed_by, 0.0, 1e9
            )
            if found
            else None
        )

    def find(self, key):
        return self.listed()

    def server(self, listed):
        return self

    def claim(self, query_id, expert, action, lease_s):
        return ClaimQueryResponse(*self.questions.claim(action, query_id, expert, lease_s))

    def answer(self, query_id, decision):
        return AnswerQueryResponse(*self.questions.answer(query_id, decision))


class Silent:
    def record(self, *_):
        """Nobody listens."""


@pytest.fixture(name='console')
def make_console(monkeypatch):
    monkeypatch.setattr(ClaimKeeper, '_run', lambda self: None)
    robot = Robot()
    return QuestionCommands(robot, Silent(), {}), robot


def give(console, command, person, page=1, **arguments):
    made, robot = console
    given = dict(arguments, question=robot.key)
    return made.carry_out(PageCommand(1, command, given), person, page)


def answer(console, person):
    return give(
        console,
        'answer',
        person,
        kind='goto',
        name='PICK',
        container='',
        outputs=[],
        why='',
        seen=None,
    )


def test_two_people_of_one_name_do_not_hold_one_claim(console):
    assert give(console, 'claim', DESK).ok
    refused = give(console, 'claim', PHONE, 2)
    assert (refused.ok, refused.message) == (False, 'ann works on this question in another browser')
    made, robot = console
    assert made.sessions.session_of(robot.listed()) == 'desk'


def test_an_answer_needs_the_claim_of_the_very_browser(console):
    assert answer(console, DESK).message == CLAIM_FIRST
    assert give(console, 'claim', DESK).ok
    for person in (PHONE, BOB):
        refused = answer(console, person)
        assert (refused.ok, refused.message) == (
            False,
            'ann works on this question; take it over first',
        )
    assert answer(console, DESK).ok
    assert console[1].listed() is None, 'it is settled'


def test_taken_over_it_is_the_other_browser_s(console):
    made, robot = console
    assert give(console, 'claim', DESK).ok
    assert give(console, 'take_over', PHONE, 2).ok
    assert made.sessions.session_of(robot.listed()) == 'phone'
    assert not answer(console, DESK).ok
    assert made.claims.leave(Claim(robot.key, 'ann'), 2), 'the page at the desk keeps it no longer'
    assert answer(console, PHONE).ok


def test_who_does_not_hold_it_gives_nothing_back(console):
    assert give(console, 'claim', DESK).ok
    assert give(console, 'release', PHONE, 2).ok
    assert console[1].listed().holder == 'ann'
    assert give(console, 'release', DESK).ok
    assert console[1].listed().holder == ''
    assert answer(console, DESK).message == CLAIM_FIRST


def test_a_claim_that_has_run_out_is_none(console, monkeypatch):
    assert give(console, 'claim', DESK).ok
    made, robot = console
    monkeypatch.setattr(
        robot,
        'listed',
        lambda: ListedQuestion('/server', ExpertQueryGoal(query_id='q'), 1, '', 0.0, 1e9),
    )
    made._front_end.find = lambda key: robot.listed()
    assert made.sessions.holds(DESK, robot.listed()), 'its server may not have told of it yet'
    later_s = session_claims.time.monotonic() + session_claims.TOLD_WITHIN_S
    monkeypatch.setattr(session_claims.time, 'monotonic', lambda: later_s)
    assert answer(console, DESK).message == CLAIM_FIRST


def test_a_claim_under_the_name_from_elsewhere_is_none_of_this_browser(console):
    made, robot = console
    assert robot.questions.claim(1, 'q', 'ann').ok, 'by a terminal, perhaps'
    assert made.sessions.session_of(robot.listed()) == ''
    assert answer(console, DESK).message == CLAIM_FIRST


def test_a_holder_who_presses_nothing_is_idle_and_a_claim_that_is_made_again_is_no_press(clock):
    robot = Robot()
    claims = session_claims.SessionClaims(idle_s=45.0)
    robot.claim('q', 'ann', ClaimQueryRequest.CLAIM, 3600.0)
    claims.take(DESK, robot.listed())
    for later_s, act, periods in (
        (44.0, None, 0),
        (2.0, None, 1),
        (0.0, claims.take, 1),
        (44.0, None, 2),
        (0.0, claims.note_press, 0),
        (46.0, None, 1),
    ):
        clock.now_s += later_s
        if act is not None:
            act(DESK, robot.listed())
        assert claims.idle_periods(robot.listed()) == periods
    claims.note_press(PHONE, robot.listed())
    assert claims.idle_periods(robot.listed()) == 1, 'another browser is not the holder'
    claims.take(PHONE, robot.listed())
    assert claims.idle_periods(robot.listed()) == 0


def test_without_a_period_nobody_is_idle(clock):
    robot = Robot()
    claims = session_claims.SessionClaims(idle_s=0.0)
    robot.claim('q', 'ann', ClaimQueryRequest.CLAIM, 3600.0)
    claims.take(DESK, robot.listed())
    clock.now_s += 1e6
    assert claims.idle_periods(robot.listed()) == 0


class FakeClock:
    now_s = 0.0


@pytest.fixture
def clock(monkeypatch):
    found = FakeClock()
    monkeypatch.setattr(session_claims.time, 'monotonic', lambda: found.now_s)
    return found
