"""A machine that obeys a preempt ends as its author drew it: it takes up its work no more."""
import pytest
from guarded_machines import OUTCOMES, both
from held_machines import Gate, Held, Trail, eventually
from machines import FakeExpert, waits

import smach
from smach_oracle.oracle.records.events import EventKind


def flat(trail, inner):
    return inner, 'SM_ROOT'


def nested(trail, inner):
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('N', inner)
    return machine, 'SM_ROOT/N'


def in_a_concurrence(trail, inner):
    machine, _ = nested(trail, both(LEFT=inner, RIGHT=trail.state('RIGHT', Gate())))
    return machine, 'SM_ROOT/N/LEFT'


def by_operator(held):
    held.hand.preempt()


def by_script(held):
    held.machine.request_preempt()


def waits_before(held, place):
    eventually(lambda: place in held.held())  # beside RIGHT, which a pause may hold


def at_a_breakpoint(held, path):
    held.hand.set_breakpoint('B')
    waits_before(held.begin(), path + '/B')


def at_a_confirmation(held, path):
    held.hand.set_autonomy('B', 'confirm')
    waits_before(held.begin(), path + '/B')


def at_the_first_state(held, path):
    held.hand.set_autonomy('A', 'confirm')
    waits_before(held.begin(), path + '/A')


def while_asked(held, path):
    held.begin()
    eventually(lambda: held.of(EventKind.QUERY_OPENED))


def while_it_runs(held, path):
    held.begin()
    eventually(lambda: any(event.state == 'B' for event in held.of(EventKind.STATE_START)))


def stopped(trail, inner, around, wait, preempt):
    """The machine around, which was preempted and has come to its end."""
    machine, path = around(trail, inner)
    held = Held(machine, expert=FakeExpert(*[waits] * 9),
                settings={'max_recoveries': 0 if wait is while_asked else 9})
    with held:
        wait(held, path)
        preempt(held)
        eventually(lambda: not held.running())
    assert len(held.of(EventKind.QUERY_OPENED)) == int(wait is while_asked), 'about B'
    assert not [each for each in held.of(EventKind.FAILURE, EventKind.JUMP) if each.state != 'B']
    return held, [label for label in trail.ran if label != 'RIGHT']


@pytest.mark.parametrize('around', [flat, nested, in_a_concurrence])
@pytest.mark.parametrize('wait, preempt, ran', [
    (at_a_breakpoint, by_operator, ['A', 'CLEAN']),
    (at_a_confirmation, by_operator, ['A', 'CLEAN']),
    (at_a_confirmation, by_script, ['A', 'CLEAN']),
    (at_the_first_state, by_script, ['CLEAN']),
    (while_asked, by_operator, ['A', 'B', 'CLEAN']),
    (while_asked, by_script, ['A', 'B', 'CLEAN']),
    (while_it_runs, by_operator, ['A', 'B', 'CLEAN']),
    (while_it_runs, by_script, ['A', 'B', 'CLEAN'])])
def test_a_clean_up_that_leads_to_a_failing_outcome_ends_the_machine(around, wait, preempt, ran):
    trail = Trail()
    work = 'aborted' if wait is while_asked else Gate()
    inner = trail.cleaned(trail.state('A'), trail.state('B', work, 'ok'), ends='aborted')
    held, has_run = stopped(trail, inner, around, wait, preempt)
    ends = 'preempted' if around is in_a_concurrence else 'aborted'
    assert (held.end(), has_run) == (ends, ran)


def fails(state, ud):
    raise ValueError('the arm is stuck')


@pytest.mark.parametrize('around', [flat, nested])
@pytest.mark.parametrize('wait', [at_a_breakpoint, while_it_runs])
@pytest.mark.parametrize('in_a_machine', [False, True])
def test_a_clean_up_that_fails_is_neither_repeated_nor_asked_about(around, wait, in_a_machine):
    trail = Trail()
    clean = trail.state('CLEAN', fails, 'ok')
    if in_a_machine:
        stow = smach.StateMachine(['ok', 'aborted'])
        with stow:
            smach.StateMachine.add('CLEAN', clean, {'preempted': 'aborted'})
        clean = stow
    inner = trail.cleaned(trail.state('A'), trail.state('B', Gate(), 'ok'), clean=clean)
    held, has_run = stopped(trail, inner, around, wait, by_operator)
    with pytest.raises(smach.InvalidUserCodeError, match='the arm is stuck'):
        raise held.error
    assert has_run[-1] == 'CLEAN' and has_run.count('CLEAN') == has_run.count('A') == 1


def test_a_nested_machine_that_is_held_at_its_door_ends_so_too():
    trail = Trail()

    def at_the_door(held, path):
        held.hand.set_autonomy('N', 'confirm')
        waits_before(held.begin(), 'SM_ROOT/N')

    held, has_run = stopped(trail, trail.cleaned(ends='aborted'), nested, at_the_door, by_script)
    assert (held.end(), has_run) == ('aborted', ['CLEAN'])


def test_the_next_execution_recovers_again():
    trail = Trail()
    inner = trail.cleaned(trail.state('A'), trail.state('B', Gate(), 'aborted', 'ok'),
                          ends='aborted')
    held, _ = stopped(trail, inner, flat, while_it_runs, by_operator)
    assert held.end() == 'aborted'
    held.begin()
    assert held.end() == 'done'
    assert trail.ran[3:].count('B') == 2
