"""Who may settle what, when, and what everybody else is told: the questions of open questions under
a clock of our own.
"""

import math
import re
import tracemalloc
from pathlib import Path

import pytest
import rospy
from expert_fixtures import make_question
from std_msgs.msg import Empty

from smach_oracle.msg import (
    ExpertDecision,
    ExpertQueryFeedback,
    ExpertQueryResult,
    OpenQuery,
    UserdataItem,
)
from smach_oracle.ros.expert.open_questions import (
    OpenQuestions,
    QuestionRefusedError,
    is_unknown,
)
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.userdata_codec import encode
from smach_oracle.srv import ClaimQueryRequest

CLAIM, RENEW, RELEASE, TAKE_OVER = (
    ClaimQueryRequest.CLAIM,
    ClaimQueryRequest.RENEW,
    ClaimQueryRequest.RELEASE,
    ClaimQueryRequest.TAKE_OVER,
)

CLAIM_SRV = Path(__file__).resolve().parents[4] / 'srv' / 'ClaimQuery.srv'


class FakeClock:
    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def clock():
    return FakeClock()


@pytest.fixture
def questions(clock):
    return OpenQuestions(lease_s=10.0, remember=3, clock=clock)


def goal(query_id='q1', **changes):
    return to_goal(make_question(query_id, **changes), '/robot', rospy.Time(1))


def goto(state='DETECT', by='ann', **fields):
    return ExpertDecision(kind=ExpertDecision.GOTO, state=state, by=by, **fields)


def supersede(outcome='succeeded', by='ann', **fields):
    return ExpertDecision(kind=ExpertDecision.SUPERSEDE, outcome=outcome, by=by, **fields)


def status_of(questions, query_id='q1'):
    return {
        entry.query.query_id: (entry.status, entry.claimed_by) for entry in questions.listing()
    }.get(query_id)


def test_questions_wait_side_by_side_oldest_first(questions, clock):
    questions.open(goal('q2'))
    clock.now_s += 1.5
    questions.open(goal('q1', deadline_s=4.0))
    clock.now_s += 1.0
    second, first = questions.listing()[1], questions.listing()[0]
    assert (first.query.query_id, first.age, first.remaining, first.lease_remaining) == (
        'q2',
        2.5,
        -1,
        -1,
    )
    assert (second.query.query_id, second.age, second.remaining, second.status) == (
        'q1',
        1.0,
        3.0,
        OpenQuery.PENDING,
    )


def test_the_same_question_again_joins_the_open_one(questions, clock):
    questions.open(goal(deadline_s=5.0))
    clock.now_s += 3.0
    assert questions.open(goal(deadline_s=5.0)) is None
    assert len(questions) == 1
    assert questions.listing()[0].remaining == 2.0, 'the deadline does not begin again'


def test_a_settled_question_asked_again_gets_its_answer(questions):
    questions.open(goal())
    questions.answer('q1', goto())
    settled = questions.open(goal())
    assert (settled.status, settled.decision.state) == (ExpertQueryResult.ANSWERED, 'DETECT')
    assert len(questions) == 0


def test_a_question_that_was_taken_back_can_be_asked_again(questions):
    questions.open(goal())
    questions.close('q1', 'taken back by the asker')
    assert questions.open(goal()) is None
    assert questions.answer('q1', goto()).ok


@pytest.mark.parametrize(
    'changes, text',
    [
        ({'query_id': ''}, 'needs a query id'),
        ({'deadline_s': -1.0}, 'deadline -1.0 is not allowed'),
        ({'deadline_s': math.nan}, 'deadline nan is not allowed'),
        ({'deadline_s': math.inf}, 'deadline inf is not allowed'),
    ],
)
def test_a_question_without_sense_is_refused(questions, changes, text):
    with pytest.raises(QuestionRefusedError, match=text):
        questions.open(goal(**changes))


def test_another_question_under_a_used_id_is_refused(questions):
    questions.open(goal())
    with pytest.raises(QuestionRefusedError, match="failed_state 'PICK' instead of 'PLACE'"):
        questions.open(goal(failed_state='PLACE'))
    questions.answer('q1', goto())
    with pytest.raises(QuestionRefusedError, match='belongs to another question'):
        questions.open(goal(container_path='ELSEWHERE'))


def test_the_answer_settles_and_the_asker_is_told(questions):
    questions.open(goal())
    questions.take_notices()
    assert questions.answer('q1', goto(why='the table was hidden')).ok
    (notice,) = questions.take_notices()
    assert notice.settled.status == ExpertQueryResult.ANSWERED
    assert (notice.settled.decision.state, notice.settled.text, notice.by) == (
        'DETECT',
        'go to DETECT',
        'ann',
    )
    assert questions.listing() == []


def test_the_same_answer_again_is_accepted(questions):
    questions.open(goal())
    questions.answer('q1', supersede(outputs=[encode('grasped', 'mug')]))
    again = questions.answer('q1', supersede(outputs=[encode('grasped', 'mug')], why='twice'))
    assert again.ok and again.settled.why == ''


def test_a_second_different_answer_is_refused_and_told_who_was_first(questions):
    questions.open(goal())
    questions.answer('q1', goto(by='ann'))
    reply = questions.answer('q1', goto('PICK', by='bob'))
    assert not reply.ok
    assert reply.message == 'ann was first: go to DETECT'
    assert (reply.settled.by, reply.settled.state) == ('ann', 'DETECT')
    assert not questions.answer('q1', supersede(by='ann')).ok


def test_another_expert_with_the_same_answer_learns_who_was_first(questions):
    questions.open(goal())
    questions.answer('q1', goto(by='ann'))
    reply = questions.answer('q1', goto(by='bob'))
    assert reply.ok and reply.settled.by == 'ann' and 'ann was first' in reply.message


def test_answers_that_differ_in_their_outputs_alone_are_different(questions):
    questions.open(goal())
    questions.answer('q1', supersede(outputs=[encode('grasped', 'mug')]))
    assert not questions.answer('q1', supersede(outputs=[encode('grasped', 'cup')])).ok


@pytest.mark.parametrize(
    'decision, text',
    [
        (goto('NOWHERE'), "no state 'NOWHERE' to go to; allowed: DETECT, PICK$"),
        (
            goto('PLACE'),
            'PLACE cannot be entered now: still running after an overrun; allowed: DETECT, PICK$',
        ),
        (supersede('done'), "no outcome 'done' to supersede it with; allowed: aborted, succeeded"),
        (
            ExpertDecision(kind=ExpertDecision.GIVE_UP, outcome='done', by='ann'),
            "no outcome 'done' to give up with",
        ),
        (
            ExpertDecision(kind=ExpertDecision.INTERFACE, interface='joystick', by='ann'),
            "no interface 'joystick' is on offer for PICK; allowed: assist",
        ),
        (ExpertDecision(kind=9, by='ann'), 'decision kind 9 is unknown; allowed: GOTO'),
        (goto(by=' '), '`by` is empty'),
        (supersede(outputs=[encode('object', 1)]), 'no output keys object; allowed: grasped'),
        (supersede(outputs=[encode('grasped', 1), encode('grasped', 2)]), 'come twice: grasped'),
        (
            supersede(outputs=[UserdataItem('grasped', UserdataItem.JSON, '', '', b'{')]),
            "'grasped' is not JSON",
        ),
        (supersede(outputs=[encode('grasped', object())]), r'\(a object\) was not sent'),
    ],
)
def test_an_answer_that_does_not_fit_is_refused_with_what_is_allowed(questions, decision, text):
    questions.open(goal())
    reply = questions.answer('q1', decision)
    assert not reply.ok and reply.settled.kind == 0
    assert re.search(text, reply.message), reply.message
    assert questions.answer('q1', goto()).ok, 'the question stays open'


@pytest.mark.parametrize(
    'decision',
    [
        goto('DETECT'),
        goto('PICK'),
        supersede('aborted'),
        supersede(outputs=[encode('grasped', Empty())]),
        ExpertDecision(kind=ExpertDecision.GIVE_UP, by='ann'),
        ExpertDecision(kind=ExpertDecision.GIVE_UP, outcome='aborted', by='ann'),
        ExpertDecision(kind=ExpertDecision.INTERFACE, interface='assist', by='ann'),
    ],
)
def test_every_decision_that_was_offered_is_taken(questions, decision):
    questions.open(goal())
    assert questions.answer('q1', decision).ok


def test_a_claimed_question_is_listed_with_its_holder_and_lease(questions, clock):
    questions.open(goal())
    assert questions.claim(CLAIM, 'q1', 'ann') == (True, 'claimed', 'ann')
    clock.now_s += 4.0
    (entry,) = questions.listing()
    assert (entry.status, entry.claimed_by, entry.lease_remaining) == (
        OpenQuery.CLAIMED,
        'ann',
        6.0,
    )


def test_a_second_claim_is_refused_and_names_the_holder(questions):
    questions.open(goal())
    questions.claim(CLAIM, 'q1', 'ann')
    assert questions.claim(CLAIM, 'q1', 'bob') == (False, 'ann works on this question', 'ann')
    assert questions.claim(RELEASE, 'q1', 'bob') == (False, 'ann works on this question', 'ann')


def test_a_claim_runs_out_unless_renewed(questions, clock):
    questions.open(goal())
    questions.claim(CLAIM, 'q1', 'ann')
    clock.now_s += 9.0
    assert questions.claim(RENEW, 'q1', 'ann').ok
    clock.now_s += 9.0
    assert status_of(questions) == (OpenQuery.CLAIMED, 'ann')
    questions.take_notices()
    clock.now_s += 1.0
    assert status_of(questions) == (OpenQuery.PENDING, '')
    (notice,) = questions.take_notices()
    assert (notice.status, notice.by) == (
        ExpertQueryFeedback.PENDING,
        'ann',
    ) and 'ran out' in notice.text
    assert questions.claim(RENEW, 'q1', 'ann') == (False, 'the claim has run out; claim again', '')
    assert questions.claim(CLAIM, 'q1', 'bob').ok


def test_a_claim_may_ask_for_another_lease(questions, clock):
    questions.open(goal())
    questions.claim(CLAIM, 'q1', 'ann', 60.0)
    clock.now_s += 59.0
    assert status_of(questions)[1] == 'ann'


def test_an_answer_by_another_is_refused_until_taken_over(questions):
    questions.open(goal())
    questions.claim(CLAIM, 'q1', 'ann')
    reply = questions.answer('q1', goto(by='bob'))
    assert not reply.ok and 'ann works on this question; take it over first' == reply.message
    assert questions.claim(TAKE_OVER, 'q1', 'bob') == (True, 'taken over from ann', 'bob')
    assert not questions.claim(RENEW, 'q1', 'ann').ok
    assert not questions.answer('q1', goto(by='ann')).ok
    assert questions.answer('q1', goto(by='bob')).ok


def test_the_asker_is_told_of_claims_in_order(questions):
    questions.open(goal())
    questions.claim(CLAIM, 'q1', 'ann')
    questions.claim(CLAIM, 'q1', 'ann')
    questions.claim(TAKE_OVER, 'q1', 'bob')
    questions.claim(RELEASE, 'q1', 'bob')
    assert [(notice.status, notice.by, notice.text) for notice in questions.take_notices()] == [
        (ExpertQueryFeedback.PENDING, '', ''),
        (ExpertQueryFeedback.CLAIMED, 'ann', 'claimed'),
        (ExpertQueryFeedback.CLAIMED, 'bob', 'taken over from ann'),
        (ExpertQueryFeedback.PENDING, 'bob', 'bob gave it back'),
    ]


@pytest.mark.parametrize(
    'arguments, text',
    [
        ((CLAIM, 'q1', ''), '`expert` is empty'),
        ((9, 'q1', 'ann'), 'action 9 is unknown; allowed'),
        ((CLAIM, 'q1', 'ann', -1.0), 'lease -1.0 is not allowed'),
        ((CLAIM, 'q1', 'ann', math.nan), 'lease nan'),
        ((CLAIM, 'q9', 'ann'), "there is no question 'q9' here"),
    ],
)
def test_a_claim_without_sense_is_refused(questions, arguments, text):
    questions.open(goal())
    reply = questions.claim(*arguments)
    assert not reply.ok and text in reply.message
    assert status_of(questions) == (OpenQuery.PENDING, '')


def test_nobody_answers_by_the_deadline(questions, clock):
    questions.open(goal(deadline_s=5.0))
    questions.claim(CLAIM, 'q1', 'ann')
    questions.take_notices()
    clock.now_s += 5.0
    questions.tick()
    (notice,) = questions.take_notices()
    assert notice.settled.status == ExpertQueryResult.EXPIRED
    reply = questions.answer('q1', goto())
    assert not reply.ok
    assert reply.message == 'the question is closed: nobody answered by the deadline'


def test_an_answer_a_moment_after_the_deadline_is_too_late_even_where_nobody_looked_at_the_clock(
    questions, clock
):
    questions.open(goal(deadline_s=5.0))
    clock.now_s += 5.0
    assert not questions.answer('q1', goto()).ok


def test_without_a_deadline_a_question_waits(questions, clock):
    questions.open(goal(deadline_s=0.0))
    clock.now_s += 1e6
    assert status_of(questions) == (OpenQuery.PENDING, '')


def test_a_question_taken_back_refuses_late_answers_with_the_reason(questions):
    questions.open(goal())
    questions.close('q1', 'the asker is gone')
    assert [notice.settled.status for notice in questions.take_notices() if notice.settled] == [
        ExpertQueryResult.CANCELLED
    ]
    assert questions.answer('q1', goto()).message == 'the question is closed: the asker is gone'
    assert (
        questions.claim(CLAIM, 'q1', 'ann').message == 'the question is closed: the asker is gone'
    )


def test_the_next_thing_due_is_the_earliest_lease_or_deadline(questions, clock):
    assert questions.next_due_s() == math.inf
    questions.open(goal('q1', deadline_s=50.0))
    questions.open(goal('q2'))
    assert questions.next_due_s() == 150.0
    questions.claim(CLAIM, 'q2', 'ann')
    assert questions.next_due_s() == 110.0


def test_only_the_refusal_of_an_unknown_question_says_that_it_is_unknown(questions):
    questions.open(goal('q1'))
    questions.open(goal('q2'))
    questions.answer('q1', goto())
    questions.claim(CLAIM, 'q2', 'bob')
    assert is_unknown(questions.claim(CLAIM, 'q9', 'ann').message)
    for query_id in ('q1', 'q2'):
        assert not is_unknown(questions.claim(CLAIM, query_id, 'ann').message)
    assert 'begins with "there is no question "' in CLAIM_SRV.read_text(encoding='utf-8')


def test_only_so_many_settled_questions_are_remembered(questions):
    for number in range(5):
        questions.open(goal('q{}'.format(number)))
        questions.answer('q{}'.format(number), goto())
    assert "there is no question 'q1'" in questions.answer('q1', goto('PICK')).message
    assert 'ann was first' in questions.answer('q4', goto('PICK')).message


def test_what_is_remembered_of_settled_questions_is_little():
    questions = OpenQuestions(remember=1000)
    tracemalloc.start()
    try:
        for number in range(200):
            userdata = {'key{}'.format(key): str(number) * 1000 for key in range(20)}
            questions.open(goal('q{}'.format(number), userdata=userdata))
            questions.answer('q{}'.format(number), goto())
            questions.take_notices()
        held_bytes, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert held_bytes < 2e6, 'less than 10 kB each; the questions are five times as large'
    assert questions.open(goal('q7')).decision.state == 'DETECT'
    with pytest.raises(QuestionRefusedError, match='belongs to another question'):
        questions.open(goal('q7', failed_state='PLACE'))


def running(query_id='q1'):
    announcement = goal(query_id)
    announcement.interface = 'assist'
    return announcement


def test_a_running_interface_is_listed_and_takes_no_answers(questions):
    questions.open(goal())
    questions.answer(
        'q1', ExpertDecision(kind=ExpertDecision.INTERFACE, interface='assist', by='ann')
    )
    assert questions.open(running()) is None
    assert status_of(questions) == (OpenQuery.INTERFACE_RUNNING, 'ann')
    assert not questions.claim(TAKE_OVER, 'q1', 'bob').ok
    assert questions.answer('q1', goto(by='bob')).message == 'ann was first: run interface assist'
    questions.close('q1', 'ended')
    assert questions.listing() == []
    assert questions.answer('q1', goto(by='bob')).message == 'ann was first: run interface assist'


def test_an_interface_is_listed_also_where_the_server_was_restarted_meanwhile(questions):
    questions.open(running())
    assert status_of(questions) == (OpenQuery.INTERFACE_RUNNING, '')


def test_an_interface_of_a_question_that_is_still_open_is_refused(questions):
    questions.open(goal())
    with pytest.raises(QuestionRefusedError, match='interface'):
        questions.open(running())
