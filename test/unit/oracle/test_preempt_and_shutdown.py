"""A preempt or a shutdown at any moment."""

import threading

import pytest
from machines import (
    FakeExpert,
    Gate,
    Scripted,
    Watched,
    chain_of,
    in_thread,
    supersede,
    waits,
    watched,
)

import smach
from smach_oracle.oracle.records.events import EventKind


def test_in_a_state():
    gate = Gate()
    machine = watched(Scripted(), Scripted(gate))
    run = in_thread(machine.run)
    assert gate.entered.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert machine.machine.preempt_requested() is False
    assert len(machine.of(EventKind.PREEMPT)) == 1
    row = machine.rate('B')
    assert (row.successes, row.failures) == (0, 0)


def test_before_the_start():
    seen = []
    machine = watched(
        Scripted(
            lambda self, ud: (
                seen.append(self.preempt_requested()) or self.service_preempt() or 'preempted'
            )
        )
    )
    machine.machine.request_preempt()
    assert machine.run() == 'preempted'
    assert seen == [True]
    assert machine.machine.preempt_requested() is False
    assert machine.run() == 'done'


@pytest.mark.parametrize('end', ['aborted', ValueError('x'), None])
def test_a_state_that_fails_while_preempted_is_not_recovered_and_not_counted(end):
    def fails(state, ud):
        holder[0].request_preempt()
        if isinstance(end, Exception):
            raise end
        return end

    machine = watched(Scripted(fails), Scripted())
    holder = [machine.machine]
    if end == 'aborted':
        assert machine.run() == 'aborted'
    else:
        with pytest.raises((smach.InvalidUserCodeError, smach.InvalidTransitionError)):
            machine.run()
    assert not machine.of(EventKind.FAILURE, EventKind.DECISION)
    assert machine.rate('A').failures == 0
    assert machine.machine.is_running() is False


def test_a_failure_at_shutdown_is_not_recovered(monkeypatch):
    def fails(state, ud):
        monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        return 'aborted'

    machine = watched(Scripted(fails), Scripted())
    assert machine.run() == 'aborted'
    assert not machine.of(EventKind.FAILURE)


def test_an_unserviced_preempt_goes_on_to_the_next_state():
    seen = []
    machine = watched(
        Scripted(lambda self, ud: holder[0].request_preempt() or 'ok'),
        Scripted(
            lambda self, ud: (
                seen.append(self.preempt_requested()) or self.service_preempt() or 'preempted'
            )
        ),
    )
    holder = [machine.machine]
    assert machine.run() == 'preempted'
    assert seen == [True]
    assert machine.machine['A'].preempt_requested() is False


def test_a_state_that_services_its_preempt_and_goes_on_clears_it_for_the_machine():
    seen = []
    machine = watched(
        Scripted(lambda self, ud: holder[0].request_preempt() or self.service_preempt() or 'ok'),
        Scripted(lambda self, ud: seen.append(self.preempt_requested()) or 'ok'),
    )
    holder = [machine.machine]
    assert machine.run() == 'done'
    assert seen == [False]


def test_a_machine_without_a_preempted_outcome_ends_as_the_failure_would_have():
    machine = chain_of(
        Scripted('aborted', outcomes=('ok', 'aborted')), outcomes=('done', 'aborted')
    )
    machine = Watched(
        machine, expert=FakeExpert(waits), settings={'max_recoveries': 0, 'deadline_s': 0}
    )
    asked = threading.Event()
    machine.machine.events.observers.append(
        lambda event: asked.set() if event.kind is EventKind.QUERY_OPENED else None
    )
    run = in_thread(machine.run)
    assert asked.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'aborted'
    assert machine.machine.preempt_requested() is False


def test_a_preempted_recovery_from_an_exception_raises_where_there_is_no_outcome_for_it():
    machine = Watched(
        chain_of(Scripted(ValueError('no grasp'), outcomes=('ok',)), outcomes=('done',)),
        preconditions={'A': [lambda ud: holder[0].request_preempt() or True]},
    )
    holder = [machine.machine]
    with pytest.raises(smach.InvalidUserCodeError, match='no grasp'):
        machine.run()
    assert machine.machine.preempt_requested() is False
    assert machine.machine.is_running() is False


@pytest.mark.parametrize(
    'kind',
    [
        EventKind.DECISION,
        EventKind.FAILURE,
        EventKind.TRANSITION,
        EventKind.QUERY_OPENED,
        EventKind.JUMP,
        EventKind.PRECONDITION_START,
    ],
)
def test_at_every_step_of_a_recovery(kind):
    """Preempted from another thread at the moment of each kind of step, the machine ends soon, and
    once only.
    """
    machine = watched(
        Scripted('aborted'),
        Scripted(Gate(), outcomes=('ok', 'preempted')),
        Scripted(Gate()),
        expert=FakeExpert(waits),
        settings={'deadline_s': 0, 'max_recoveries': int(kind is not EventKind.QUERY_OPENED)},
        preconditions={'A': [lambda ud: True]},
    )
    calls = []

    def preempt(event):
        if event.kind is kind and not calls:
            calls.append(in_thread(machine.machine.request_preempt))

    machine.machine.events.observers.append(preempt)
    run = in_thread(machine.run)
    assert run.result() == 'preempted'
    calls[0].result()
    assert machine.machine.is_running() is False
    assert machine.kinds().count('TRIAL_END') == 1


def test_a_preempt_in_a_query_of_a_nested_machine_ends_all():
    inner = chain_of(Scripted('aborted'))
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('INNER', inner, {'done': 'done'})
    machine = Watched(
        outer, expert=FakeExpert(waits), settings={'deadline_s': 0, 'max_recoveries': 0}
    )
    asked = threading.Event()
    machine.machine.events.observers.append(
        lambda event: asked.set() if event.kind is EventKind.QUERY_OPENED else None
    )
    run = in_thread(machine.run)
    assert asked.wait(10)
    assert machine.machine.get_active_states() == ['INNER']
    assert inner.get_active_states() == ['ORACLE']
    machine.machine.request_preempt()
    assert run.result() == 'preempted'


def test_a_preempt_that_the_last_state_has_not_serviced_stays():
    def ends_unserviced(state, ud):
        machine.machine.request_preempt()
        return 'preempted'

    machine = watched(Scripted(ends_unserviced))
    assert machine.run() == 'preempted'
    assert machine.machine.preempt_requested()


def test_the_next_run_after_a_preempted_one_is_as_any_other():
    machine = watched(
        Scripted('aborted'),
        Scripted(),
        expert=FakeExpert(waits, supersede('ok')),
        settings={'max_recoveries': 0, 'deadline_s': 0},
    )
    asked = threading.Event()
    machine.machine.events.observers.append(
        lambda event: asked.set() if event.kind is EventKind.QUERY_OPENED else None
    )
    run = in_thread(machine.run)
    assert asked.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    machine.machine['A'].script.append('aborted')
    assert machine.run() == 'done'


class NotesOnly(smach.StateMachine):
    """Only notes a request. Its states hear of it at their boundaries."""

    def request_preempt(self):
        smach.State.request_preempt(self)


def test_each_request_that_a_machine_only_notes_reaches_the_next_state_once():
    def asks(state, ud):
        machine.machine.request_preempt()
        return 'ok'

    def serviced(state, ud):
        heard.append(state.preempt_requested())
        state.service_preempt()
        return 'ok'

    heard = []
    steps = [asks, serviced, serviced] * 2
    machine = Watched(chain_of(*map(Scripted, steps), machine_class=NotesOnly))
    assert machine.run() == 'done'
    assert heard == [True, False] * 2
    assert [event.state for event in machine.of(EventKind.PREEMPT)] == ['A', 'D']


def test_a_request_between_two_states_is_told_before_the_next_one_begins():
    bare = chain_of(Scripted(), Scripted('preempted'), machine_class=NotesOnly)
    machine = Watched(bare)
    machine.machine.register_transition_cb(lambda *_: machine.machine.request_preempt())
    machine.run()
    told = machine.of(EventKind.PREEMPT, EventKind.STATE_START)
    assert [(event.kind.name, event.state) for event in told[1:]] == [
        ('PREEMPT', 'B'),
        ('STATE_START', 'B'),
    ]


def test_a_machine_that_only_notes_a_request_has_serviced_it_where_it_ends_preempted():
    machine = Watched(
        chain_of(
            Scripted(lambda state, ud: machine.machine.request_preempt() or 'preempted'),
            machine_class=NotesOnly,
        )
    )
    assert machine.run() == 'preempted'
    assert machine.machine.preempt_requested() is False
    assert machine.run() == 'done'
