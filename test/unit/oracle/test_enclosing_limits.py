"""The time limit of a state that holds a machine, while that machine asks a person."""

import threading

import pytest
from machines import (
    FakeExpert,
    Gate,
    Scripted,
    Watched,
    chain_of,
    goto,
    in_thread,
    interface,
    supersede,
)
from test_time_limits import LimitClock
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind, FailureKind

SETTINGS = {'max_recoveries': 0, 'deadline_s': 0, 'interfaces': {'hand': {'action': 'hand/assist'}}}


@pytest.fixture
def clock(monkeypatch):
    """The limit of X is over as soon as somebody is asked."""
    clock = LimitClock(monkeypatch)
    clock.asked = threading.Event()
    clock.end(1, clock.asked)
    return clock


def slow_expert(clock, *answers):
    """Answers once the limit of X would have been over, unless the question is taken back."""

    def answering(answer):
        def after_the_limit(question, cancelled, progress):
            clock.asked.set()
            assert wait_for(lambda: clock.all_over() or cancelled.is_set())
            assert not cancelled.wait(0.2), 'the limit has taken the question back'
            return answer

        return after_the_limit

    return [answering(answer) for answer in answers]


def around(label, child):
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add(label, child, {'done': 'done'})
    return outer


def limited(child, expert, limit_s=30.0):
    return Watched(
        around('X', child),
        expert=expert,
        settings=dict(SETTINGS, states={'X': {'time_limit_s': limit_s, 'grace_period_s': 5.0}}),
    )


def assert_nobody_was_disturbed(machine):
    assert [event.failure_kind for event in machine.of(EventKind.FAILURE)] == [
        FailureKind.FELL_THROUGH
    ]
    assert not machine.of(EventKind.QUERY_CANCELLED, EventKind.QUERY_EXPIRED, EventKind.PREEMPT)


def test_the_limit_stands_still_while_an_inner_machine_asks(clock):
    machine = limited(
        chain_of(Scripted('aborted')), FakeExpert(*slow_expert(clock, supersede('ok')))
    )
    assert machine.run() == 'done'
    assert_nobody_was_disturbed(machine)


def test_it_stands_still_for_a_machine_deep_below(clock):
    machine = limited(
        around('MIDDLE', chain_of(Scripted('aborted'))),
        FakeExpert(*slow_expert(clock, supersede('ok'))),
    )
    assert machine.run() == 'done'
    assert_nobody_was_disturbed(machine)


def test_it_stands_still_for_one_branch_of_a_concurrence(clock):
    branches = {'LEFT': chain_of(Scripted('aborted')), 'RIGHT': chain_of(Scripted())}
    both = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': dict.fromkeys(branches, 'done')},
    )
    with both:
        for label, branch in branches.items():
            smach.Concurrence.add(label, branch)
    machine = limited(both, FakeExpert(*slow_expert(clock, supersede('ok'))))
    assert machine.run() == 'done'
    assert_nobody_was_disturbed(machine)


def test_it_stands_still_for_a_machine_that_a_state_executes_itself(clock):
    own = OracleContainer.wrap(
        chain_of(Scripted('aborted')),
        settings=SETTINGS,
        expert=FakeExpert(*slow_expert(clock, supersede('ok'))),
    )
    machine = limited(Scripted(lambda state, ud: own.execute(), outcomes=('done', 'aborted')), None)
    assert machine.run() == 'done'
    assert not machine.of(EventKind.FAILURE)


def test_it_stands_still_while_an_interface_works(clock):
    (work,) = slow_expert(clock, supersede('ok'))
    machine = limited(
        chain_of(Scripted('aborted')),
        FakeExpert(interface('hand'), interface=lambda offer, *args: work(*args)),
    )
    assert machine.run() == 'done'
    assert_nobody_was_disturbed(machine)


def test_it_goes_on_after_the_answer():
    gate = Gate()
    machine = limited(
        chain_of(Scripted('aborted'), Scripted(gate)),
        FakeExpert(goto('B'), supersede('done')),
        limit_s=0.1,
    )
    assert machine.run() == 'done'
    assert gate.entered.is_set()
    assert machine.of(EventKind.FAILURE)[-1].failure_kind == FailureKind.TIME_LIMIT


def test_a_preempt_ends_the_question_and_all_around_it(clock):
    asked = threading.Event()

    def waits(question, cancelled, progress):
        asked.set()
        assert cancelled.wait(20)

    machine = limited(chain_of(Scripted('aborted')), FakeExpert(waits))
    run = in_thread(machine.run)
    assert asked.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
