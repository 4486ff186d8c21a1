"""The program asks a state, or a machine inside another, to stop: the oracle repeats neither."""

import pytest
from machines import FakeExpert, Gate, Scripted, Watched, chain_of, in_thread
from waiting import wait_for

import smach
from smach_oracle.oracle.records.events import EventKind

ENDS = ('done', 'aborted', 'preempted')


def inside(state, label='PART', **transitions):
    """A machine of that state; BACK is what its author may draw."""
    machine = smach.StateMachine(outcomes=list(ENDS))
    with machine:
        smach.StateMachine.add(label, state, transitions)
        smach.StateMachine.add('BACK', Scripted(), {'ok': 'done'})
    return machine


def asked_to_stop(asks, outcome, services):
    """A state that is asked to stop while it runs, and ends with an outcome, or by an error."""

    def step(state, ud):
        asks(state)
        if services:
            state.service_preempt()
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    return Scripted(step)


@pytest.mark.parametrize('services', [True, False])
@pytest.mark.parametrize('outcome', ['aborted', 'preempted'])
def test_a_machine_that_is_asked_to_stop_is_not_entered_again(outcome, services):
    work = asked_to_stop(lambda state: part.request_preempt(), outcome, services)
    part = smach.StateMachine(outcomes=list(ENDS))
    with part:
        smach.StateMachine.add('WORK', work, {'ok': 'done', 'preempted': 'aborted'})
    machine = Watched(inside(part), name='TOP')
    assert machine.run() == 'aborted'
    assert work.runs == 1
    assert not machine.of(EventKind.DECISION, EventKind.FAILURE)
    assert machine.rate('PART').failures == 0, 'it has not failed: it was asked to stop'


def test_what_its_author_drew_for_its_end_is_next():
    work = asked_to_stop(lambda state: part.request_preempt(), 'aborted', True)
    part = chain_of(work)
    top = inside(part, aborted='BACK')
    machine = Watched(top, name='TOP')
    assert machine.run() == 'done'
    assert (work.runs, top['BACK'].runs) == (1, 1)


def test_all_machines_around_it_end_as_drawn():
    work = asked_to_stop(lambda state: part.request_preempt(), 'aborted', True)
    part = chain_of(work)
    machine = Watched(inside(inside(part, 'MIDDLE'), 'OUTER'), name='TOP')
    assert machine.run() == 'aborted'
    assert work.runs == 1


def test_the_machine_around_recovers_from_what_fails_later():
    work = asked_to_stop(lambda state: part.request_preempt(), 'aborted', True)
    part = chain_of(work)
    top = inside(part, aborted='BACK')
    top['BACK'].script.append('aborted')
    machine = Watched(top, name='TOP')
    assert machine.run() == 'done'
    assert top['BACK'].runs == 2


def test_a_machine_that_runs_again_is_recovered_again():
    work = asked_to_stop(lambda state: part.request_preempt(), 'aborted', True)
    part = chain_of(work)
    machine = Watched(inside(part), name='TOP')
    assert machine.run() == 'aborted'
    work.script.append('aborted')
    assert machine.run() == 'done'
    assert work.runs == 3


def test_a_question_inside_it_is_taken_back_and_nobody_is_asked_above():
    part = chain_of(Scripted('aborted'))
    expert = FakeExpert(lambda question, cancelled, progress: cancelled.wait(20) and None)
    machine = Watched(inside(part), name='TOP', expert=expert, settings={'max_recoveries': 0})
    run = in_thread(machine.run)
    assert wait_for(lambda: expert.questions)
    part.request_preempt()
    assert run.result() == 'preempted'
    assert len(expert.questions) == 1


@pytest.mark.parametrize('outcome', ['aborted', ValueError('stopped')])
def test_a_state_that_has_not_serviced_the_request_is_not_tried_again(outcome):
    work = asked_to_stop(lambda state: state.request_preempt(), outcome, False)
    machine = Watched(chain_of(work), name='TOP')
    if isinstance(outcome, Exception):
        with pytest.raises(smach.InvalidUserCodeError):
            machine.run()
    else:
        assert machine.run() == 'aborted'
    assert work.runs == 1


def test_a_state_that_overruns_is_asked_by_the_oracle_and_is_tried_again():
    gate = Gate()
    work = Scripted(gate)
    part = chain_of(work)
    machine = Watched(
        inside(part), name='TOP', settings={'states': {'PART': {'time_limit_s': 0.05}}}
    )
    assert machine.run() == 'done'
    assert work.runs == 2


def test_a_machine_that_a_concurrence_has_asked_is_no_part_that_the_program_stops():
    """The failure is that of the other branch, and the level above recovers from it."""
    drive, other = Scripted(Gate()), Scripted('aborted')
    both = smach.Concurrence(
        list(ENDS),
        'aborted',
        outcome_map={'done': {'DRIVE': 'done', 'OTHER': 'ok'}},
        child_termination_cb=lambda ended: ended['OTHER'] == 'aborted',
    )
    with both:
        smach.Concurrence.add('DRIVE', chain_of(drive))
        smach.Concurrence.add('OTHER', other)
    machine = Watched(inside(both), name='TOP')
    assert machine.run() == 'done'
    assert (drive.runs, other.runs) == (2, 2)
