"""Who may settle what, when, and what everybody else is told: the book of open questions under a clock of our own."""
import math
import re
import tracemalloc

import pytest
from expert_fixtures import make_question
from std_msgs.msg import Empty

import rospy
from smach_oracle.msg import ExpertDecision, ExpertQueryFeedback, ExpertQueryResult, OpenQuery, UserdataItem
from smach_oracle.ros.query_book import BadQuestion, QueryBook
from smach_oracle.ros.question_messages import to_goal
from smach_oracle.ros.userdata_codec import encode
from smach_oracle.srv import ClaimQueryRequest

CLAIM, RENEW, RELEASE, TAKE_OVER = (ClaimQueryRequest.CLAIM, ClaimQueryRequest.RENEW, ClaimQueryRequest.RELEASE,
                                    ClaimQueryRequest.TAKE_OVER)


class FakeClock:
    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def clock():
    return FakeClock()


@pytest.fixture
def book(clock):
    return QueryBook(lease_s=10.0, remember=3, clock=clock)


def goal(query_id='q1', **changes):
    return to_goal(make_question(query_id, **changes), '/robot', rospy.Time(1))


def goto(state='DETECT', by='ann', **fields):
    return ExpertDecision(kind=ExpertDecision.GOTO, state=state, by=by, **fields)


def supersede(outcome='succeeded', by='ann', **fields):
    return ExpertDecision(kind=ExpertDecision.SUPERSEDE, outcome=outcome, by=by, **fields)


def status_of(book, query_id='q1'):
    return {entry.query.query_id: (entry.status, entry.claimed_by) for entry in book.listing()}.get(query_id)


def test_questions_wait_side_by_side_oldest_first(book, clock):
    book.open(goal('q2'))
    clock.now_s += 1.5
    book.open(goal('q1', deadline_s=4.0))
    clock.now_s += 1.0
    second, first = book.listing()[1], book.listing()[0]
    assert (first.query.query_id, first.age, first.remaining, first.lease_remaining) == ('q2', 2.5, -1, -1)
    assert (second.query.query_id, second.age, second.remaining, second.status) == ('q1', 1.0, 3.0, OpenQuery.PENDING)


def test_the_same_question_again_joins_the_open_one(book, clock):
    book.open(goal(deadline_s=5.0))
    clock.now_s += 3.0
    assert book.open(goal(deadline_s=5.0)) is None
    assert len(book) == 1
    assert book.listing()[0].remaining == 2.0, 'the deadline does not begin anew'


def test_a_settled_question_asked_again_gets_its_answer(book):
    book.open(goal())
    book.answer('q1', goto())
    settled = book.open(goal())
    assert (settled.status, settled.decision.state) == (ExpertQueryResult.ANSWERED, 'DETECT')
    assert len(book) == 0


def test_a_question_that_was_taken_back_can_be_asked_again(book):
    book.open(goal())
    book.close('q1', 'taken back by the asker')
    assert book.open(goal()) is None
    assert book.answer('q1', goto()).ok


@pytest.mark.parametrize('changes, text', [
    ({'query_id': ''}, 'needs a query id'),
    ({'deadline_s': -1.0}, 'deadline -1.0 is not allowed'),
    ({'deadline_s': math.nan}, 'deadline nan is not allowed'),
    ({'deadline_s': math.inf}, 'deadline inf is not allowed')])
def test_a_question_without_sense_is_refused(book, changes, text):
    with pytest.raises(BadQuestion, match=text):
        book.open(goal(**changes))


def test_another_question_under_a_used_id_is_refused(book):
    book.open(goal())
    with pytest.raises(BadQuestion, match="failed_state 'PICK' instead of 'PLACE'"):
        book.open(goal(failed_state='PLACE'))
    book.answer('q1', goto())
    with pytest.raises(BadQuestion, match='belongs to another question'):
        book.open(goal(container_path='ELSEWHERE'))


def test_the_answer_settles_and_the_asker_is_told(book):
    book.open(goal())
    book.drain()
    assert book.answer('q1', goto(why='the table was hidden')).ok
    notice, = book.drain()
    assert notice.settled.status == ExpertQueryResult.ANSWERED
    assert (notice.settled.decision.state, notice.settled.text, notice.by) == ('DETECT', 'go to DETECT', 'ann')
    assert book.listing() == []


def test_the_same_answer_again_is_accepted(book):
    book.open(goal())
    book.answer('q1', supersede(outputs=[encode('grasped', 'mug')]))
    again = book.answer('q1', supersede(outputs=[encode('grasped', 'mug')], why='twice'))
    assert again.ok and again.settled.why == ''


def test_a_second_different_answer_is_refused_and_told_who_was_first(book):
    book.open(goal())
    book.answer('q1', goto(by='ann'))
    reply = book.answer('q1', goto('PICK', by='bob'))
    assert not reply.ok
    assert reply.message == 'ann was first: go to DETECT'
    assert (reply.settled.by, reply.settled.state) == ('ann', 'DETECT')
    assert not book.answer('q1', supersede(by='ann')).ok


def test_another_expert_with_the_same_answer_learns_who_was_first(book):
    book.open(goal())
    book.answer('q1', goto(by='ann'))
    reply = book.answer('q1', goto(by='bob'))
    assert reply.ok and reply.settled.by == 'ann' and 'ann was first' in reply.message


def test_answers_that_differ_in_their_outputs_alone_are_different(book):
    book.open(goal())
    book.answer('q1', supersede(outputs=[encode('grasped', 'mug')]))
    assert not book.answer('q1', supersede(outputs=[encode('grasped', 'cup')])).ok


@pytest.mark.parametrize('decision, text', [
    (goto('NOWHERE'), "no state 'NOWHERE' to go to; allowed: DETECT, PICK$"),
    (goto('PLACE'), 'PLACE cannot be entered now: still running after an overrun; allowed: DETECT, PICK$'),
    (supersede('done'), "no outcome 'done' to supersede it with; allowed: aborted, succeeded"),
    (ExpertDecision(kind=ExpertDecision.GIVE_UP, outcome='done', by='ann'), "no outcome 'done' to give up with"),
    (ExpertDecision(kind=ExpertDecision.INTERFACE, interface='joystick', by='ann'),
     "no interface 'joystick' is on offer for PICK; allowed: assist"),
    (ExpertDecision(kind=9, by='ann'), 'decision kind 9 is unknown; allowed: GOTO'),
    (goto(by=' '), '`by` is empty'),
    (supersede(outputs=[encode('object', 1)]), 'no output keys object; allowed: grasped'),
    (supersede(outputs=[encode('grasped', 1), encode('grasped', 2)]), 'come twice: grasped'),
    (supersede(outputs=[UserdataItem('grasped', UserdataItem.JSON, '', '', b'{')]), "'grasped' is not JSON"),
    (supersede(outputs=[encode('grasped', object())]), r'\(a object\) was not sent'),
])
def test_an_answer_that_does_not_fit_is_refused_with_what_is_allowed(book, decision, text):
    book.open(goal())
    reply = book.answer('q1', decision)
    assert not reply.ok and reply.settled.kind == 0
    assert re.search(text, reply.message), reply.message
    assert book.answer('q1', goto()).ok, 'the question stays open'


@pytest.mark.parametrize('decision', [
    goto('DETECT'), goto('PICK'), supersede('aborted'), supersede(outputs=[encode('grasped', Empty())]),
    ExpertDecision(kind=ExpertDecision.GIVE_UP, by='ann'),
    ExpertDecision(kind=ExpertDecision.GIVE_UP, outcome='aborted', by='ann'),
    ExpertDecision(kind=ExpertDecision.INTERFACE, interface='assist', by='ann')])
def test_every_decision_that_was_offered_is_taken(book, decision):
    book.open(goal())
    assert book.answer('q1', decision).ok


def test_a_claimed_question_is_listed_with_its_holder_and_lease(book, clock):
    book.open(goal())
    assert book.claim(CLAIM, 'q1', 'ann') == (True, 'claimed', 'ann')
    clock.now_s += 4.0
    entry, = book.listing()
    assert (entry.status, entry.claimed_by, entry.lease_remaining) == (OpenQuery.CLAIMED, 'ann', 6.0)


def test_a_second_claim_is_refused_and_names_the_holder(book):
    book.open(goal())
    book.claim(CLAIM, 'q1', 'ann')
    assert book.claim(CLAIM, 'q1', 'bob') == (False, 'ann works on this question', 'ann')
    assert book.claim(RELEASE, 'q1', 'bob') == (False, 'ann works on this question', 'ann')


def test_a_claim_runs_out_unless_renewed(book, clock):
    book.open(goal())
    book.claim(CLAIM, 'q1', 'ann')
    clock.now_s += 9.0
    assert book.claim(RENEW, 'q1', 'ann').ok
    clock.now_s += 9.0
    assert status_of(book) == (OpenQuery.CLAIMED, 'ann')
    book.drain()
    clock.now_s += 1.0
    assert status_of(book) == (OpenQuery.PENDING, '')
    notice, = book.drain()
    assert (notice.status, notice.by) == (ExpertQueryFeedback.PENDING, 'ann') and 'ran out' in notice.text
    assert book.claim(RENEW, 'q1', 'ann') == (False, 'the claim has run out; claim again', '')
    assert book.claim(CLAIM, 'q1', 'bob').ok


def test_a_claim_may_ask_for_another_lease(book, clock):
    book.open(goal())
    book.claim(CLAIM, 'q1', 'ann', 60.0)
    clock.now_s += 59.0
    assert status_of(book)[1] == 'ann'


def test_an_answer_by_another_is_refused_until_taken_over(book):
    book.open(goal())
    book.claim(CLAIM, 'q1', 'ann')
    reply = book.answer('q1', goto(by='bob'))
    assert not reply.ok and 'ann works on this question; take it over first' == reply.message
    assert book.claim(TAKE_OVER, 'q1', 'bob') == (True, 'taken over from ann', 'bob')
    assert not book.claim(RENEW, 'q1', 'ann').ok
    assert not book.answer('q1', goto(by='ann')).ok
    assert book.answer('q1', goto(by='bob')).ok


def test_the_asker_is_told_of_claims_in_order(book):
    book.open(goal())
    book.claim(CLAIM, 'q1', 'ann')
    book.claim(CLAIM, 'q1', 'ann')
    book.claim(TAKE_OVER, 'q1', 'bob')
    book.claim(RELEASE, 'q1', 'bob')
    assert [(notice.status, notice.by, notice.text) for notice in book.drain()] == [
        (ExpertQueryFeedback.PENDING, '', ''), (ExpertQueryFeedback.CLAIMED, 'ann', 'claimed'),
        (ExpertQueryFeedback.CLAIMED, 'bob', 'taken over from ann'),
        (ExpertQueryFeedback.PENDING, 'bob', 'bob gave it back')]


@pytest.mark.parametrize('arguments, text', [
    ((CLAIM, 'q1', ''), '`expert` is empty'), ((9, 'q1', 'ann'), 'action 9 is unknown; allowed'),
    ((CLAIM, 'q1', 'ann', -1.0), 'lease -1.0 is not allowed'), ((CLAIM, 'q1', 'ann', math.nan), 'lease nan'),
    ((CLAIM, 'q9', 'ann'), "there is no question 'q9' here")])
def test_a_claim_without_sense_is_refused(book, arguments, text):
    book.open(goal())
    reply = book.claim(*arguments)
    assert not reply.ok and text in reply.message
    assert status_of(book) == (OpenQuery.PENDING, '')


def test_nobody_answers_by_the_deadline(book, clock):
    book.open(goal(deadline_s=5.0))
    book.claim(CLAIM, 'q1', 'ann')
    book.drain()
    clock.now_s += 5.0
    book.tick()
    notice, = book.drain()
    assert notice.settled.status == ExpertQueryResult.EXPIRED
    reply = book.answer('q1', goto())
    assert not reply.ok and reply.message == 'the question is closed: nobody answered by the deadline'


def test_an_answer_a_moment_after_the_deadline_is_too_late_even_where_nobody_looked_at_the_clock(book, clock):
    book.open(goal(deadline_s=5.0))
    clock.now_s += 5.0
    assert not book.answer('q1', goto()).ok


def test_without_a_deadline_a_question_waits(book, clock):
    book.open(goal(deadline_s=0.0))
    clock.now_s += 1e6
    assert status_of(book) == (OpenQuery.PENDING, '')


def test_a_question_taken_back_refuses_late_answers_with_the_reason(book):
    book.open(goal())
    book.close('q1', 'the asker is gone')
    assert [notice.settled.status for notice in book.drain() if notice.settled] == [ExpertQueryResult.CANCELLED]
    assert book.answer('q1', goto()).message == 'the question is closed: the asker is gone'
    assert book.claim(CLAIM, 'q1', 'ann').message == 'the question is closed: the asker is gone'


def test_the_next_thing_due_is_the_earliest_lease_or_deadline(book, clock):
    assert book.next_due_s() == math.inf
    book.open(goal('q1', deadline_s=50.0))
    book.open(goal('q2'))
    assert book.next_due_s() == 150.0
    book.claim(CLAIM, 'q2', 'ann')
    assert book.next_due_s() == 110.0


def test_only_so_many_settled_questions_are_remembered(book):
    for number in range(5):
        book.open(goal('q{}'.format(number)))
        book.answer('q{}'.format(number), goto())
    assert "there is no question 'q1'" in book.answer('q1', goto('PICK')).message
    assert 'ann was first' in book.answer('q4', goto('PICK')).message


def test_what_is_remembered_of_settled_questions_is_little():
    book = QueryBook(remember=1000)
    tracemalloc.start()
    try:
        for number in range(200):
            userdata = {'key{}'.format(key): str(number) * 1000 for key in range(20)}
            book.open(goal('q{}'.format(number), userdata=userdata))
            book.answer('q{}'.format(number), goto())
            book.drain()
        held_bytes, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert held_bytes < 2e6, 'that is less than 10 kB each; the questions themselves are five times as large'
    assert book.open(goal('q7')).decision.state == 'DETECT'
    with pytest.raises(BadQuestion, match='belongs to another question'):
        book.open(goal('q7', failed_state='PLACE'))


def running(query_id='q1'):
    announcement = goal(query_id)
    announcement.interface = 'assist'
    return announcement


def test_a_running_interface_is_listed_and_takes_no_answers(book):
    book.open(goal())
    book.answer('q1', ExpertDecision(kind=ExpertDecision.INTERFACE, interface='assist', by='ann'))
    assert book.open(running()) is None
    assert status_of(book) == (OpenQuery.INTERFACE_RUNNING, 'ann')
    assert not book.claim(TAKE_OVER, 'q1', 'bob').ok
    assert book.answer('q1', goto(by='bob')).message == 'ann was first: run interface assist'
    book.close('q1', 'ended')
    assert book.listing() == []
    assert book.answer('q1', goto(by='bob')).message == 'ann was first: run interface assist'


def test_an_interface_is_listed_also_where_the_server_was_restarted_meanwhile(book):
    book.open(running())
    assert status_of(book) == (OpenQuery.INTERFACE_RUNNING, '')


def test_an_interface_of_a_question_that_is_still_open_is_refused(book):
    book.open(goal())
    with pytest.raises(BadQuestion, match='interface'):
        book.open(running())
