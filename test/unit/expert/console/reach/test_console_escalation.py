"""Who is called when: in turn, not while somebody works on it, and not in quiet hours."""

from datetime import datetime

import pytest

from smach_oracle.expert.console.reach.escalation import Escalation
from smach_oracle.expert.console.reach.on_call import CallStep, OnCallList, OnCallPerson
from smach_oracle.expert.console.reach.quiet_hours import QuietHours

NOON = datetime(2026, 1, 2, 12, 0)
NIGHT = datetime(2026, 1, 2, 23, 0)


def escalation(quiet=(), steps=((0.0, 'ann'), (300.0, 'bob'), (600.0, 'ann', 'eve'))):
    people = {
        name: OnCallPerson((), QuietHours('quiet', ['22:00-07:00'] if name in quiet else []))
        for name in ('ann', 'bob', 'eve')
    }
    return Escalation(OnCallList(people, tuple(CallStep(at, who) for at, *who in steps)))


def called(calls, now_s, waits=True, moment=NOON):
    return [due.person for due in calls.due(now_s, moment, {'q': waits})]


def test_the_next_person_is_called_after_a_time_and_each_once():
    calls = escalation()
    assert [called(calls, now_s) for now_s in (0, 299, 300, 599, 600, 9999)] == [
        ['ann'],
        [],
        ['bob'],
        [],
        ['eve'],
        [],
    ]


def test_nobody_is_called_while_somebody_works_on_it():
    calls = escalation()
    assert called(calls, 0) == ['ann']
    assert called(calls, 100) == []
    assert called(calls, 1000, waits=False) == []
    assert called(calls, 1199) == [], 'it has waited for 299 s'
    assert called(calls, 1200) == ['bob']


def test_who_has_quiet_hours_is_passed_over_and_the_next_is_called_at_once():
    calls = escalation(quiet=['ann'])
    assert called(calls, 0, moment=NIGHT) == ['bob']
    assert called(calls, 599, moment=NIGHT) == []
    assert called(calls, 600, moment=NIGHT) == ['eve']


def test_where_all_have_quiet_hours_the_first_is_called_when_they_end():
    calls = escalation(quiet=['ann', 'bob', 'eve'])
    assert called(calls, 0, moment=NIGHT) == []
    assert called(calls, 900, moment=NIGHT) == []
    assert called(calls, 1000, moment=NOON) == ['ann']
    assert called(calls, 2000, moment=NOON) == []


def test_a_question_that_is_gone_is_forgotten():
    calls = escalation()
    assert called(calls, 0) == ['ann']
    assert calls.due(1, NOON, {}) == []
    assert called(calls, 2) == ['ann'], 'it is another one'


def test_a_call_that_was_not_made_is_made_when_the_question_waits_again():
    calls = escalation()
    (due,) = calls.due(0, NOON, {'q': True})
    for _ in range(2):  # by each way to reach a person
        calls.take_back(due)
    assert called(calls, 1, waits=False) == []
    assert called(calls, 2) == ['ann']
    assert called(calls, 3) == []


def test_where_nobody_was_reached_the_next_is_called_at_once():
    calls = escalation(steps=((0.0, 'ann', 'bob'), (300.0, 'eve')))
    ann, bob = calls.due(0, NOON, {'q': True})
    calls.not_reached(ann)
    assert called(calls, 1) == [], 'bob was'
    calls.not_reached(bob)
    assert called(calls, 2) == ['eve']
    assert called(calls, 3) == []


def test_who_comes_next_is_known():
    calls = escalation(quiet=['eve'])
    assert calls.next_call('q', NOON) is None
    called(calls, 0)
    called(calls, 100)
    assert calls.next_call('q', NOON) == (['bob'], pytest.approx(200.0))
    called(calls, 300)
    assert calls.next_call('q', NIGHT) == (['ann'], pytest.approx(300.0))
    called(calls, 600)
    assert calls.next_call('q', NOON) is None
