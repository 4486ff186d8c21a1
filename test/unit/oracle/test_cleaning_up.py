"""A machine that obeys a preempt ends as its author drew it: it takes up its work no more."""

import pytest
from guarded_machines import OUTCOMES, both
from held_machines import LIMIT_S, Gate, Held, Trail, eventually
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
    """The machine around, which was preempted and has come to its end; the states that ran."""
    machine, path = around(trail, inner)
    held = Held(
        machine,
        expert=FakeExpert(*[waits] * 9),
        settings={'max_recoveries': 0 if wait is while_asked else 9},
    )
    with held:
        wait(held, path)
        preempt(held)
        eventually(lambda: not held.running())
    assert len(held.of(EventKind.QUERY_OPENED)) == int(wait is while_asked), 'about B'
    return held, [label for label in trail.ran if label != 'RIGHT']


def recovers_from_nothing(held):
    failed = held.of(EventKind.FAILURE, EventKind.JUMP)
    return not [each for each in failed if each.state != 'B']


@pytest.mark.parametrize('around', [flat, nested, in_a_concurrence])
@pytest.mark.parametrize(
    'wait, preempt, ran',
    [
        (at_a_breakpoint, by_operator, ['A', 'CLEAN']),
        (at_a_confirmation, by_operator, ['A', 'CLEAN']),
        (at_a_confirmation, by_script, ['A', 'CLEAN']),
        (at_the_first_state, by_script, ['CLEAN']),
        (while_asked, by_operator, ['A', 'B', 'CLEAN']),
        (while_asked, by_script, ['A', 'B', 'CLEAN']),
        (while_it_runs, by_operator, ['A', 'B', 'CLEAN']),
        (while_it_runs, by_script, ['A', 'B', 'CLEAN']),
    ],
)
def test_a_clean_up_that_leads_to_a_failing_outcome_ends_the_machine(around, wait, preempt, ran):
    trail = Trail()
    work = 'aborted' if wait is while_asked else Gate()
    inner = trail.cleaned(trail.state('A'), trail.state('B', work, 'ok'), ends='aborted')
    held, has_run = stopped(trail, inner, around, wait, preempt)
    ends = 'preempted' if around is in_a_concurrence else 'aborted'
    assert (held.end(), has_run) == (ends, ran)
    assert recovers_from_nothing(held)


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
    assert recovers_from_nothing(held)


def test_a_nested_machine_that_is_held_at_its_door_ends_so_too():
    trail = Trail()

    def at_the_door(held, path):
        held.hand.set_autonomy('N', 'confirm')
        waits_before(held.begin(), 'SM_ROOT/N')

    held, has_run = stopped(trail, trail.cleaned(ends='aborted'), nested, at_the_door, by_script)
    assert (held.end(), has_run) == ('aborted', ['CLEAN'])
    assert recovers_from_nothing(held)


def test_the_next_execution_recovers_again():
    trail = Trail()
    inner = trail.cleaned(
        trail.state('A'), trail.state('B', Gate(), 'aborted', 'ok'), ends='aborted'
    )
    held, _ = stopped(trail, inner, flat, while_it_runs, by_operator)
    assert held.end() == 'aborted'
    held.begin()
    assert held.end() == 'done'
    assert trail.ran[3:].count('B') == 2


def works_on(trail, after_b):
    """A, then B, which waits until it is preempted, and leads to `after_b` then. C fails once."""
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('A', trail.state('A'), {'ok': 'B'})
        smach.StateMachine.add(
            'B', trail.state('B', Gate(), 'ok'), {'ok': 'C', 'preempted': after_b}
        )
        smach.StateMachine.add('C', trail.state('C', 'aborted', 'ok'), {'ok': 'done'})
        smach.StateMachine.add('CLEAN', trail.state('CLEAN'), {'ok': 'A'})
    return machine


@pytest.mark.parametrize(
    'after_b, ran',
    [('A', ['A', 'B', 'A', 'B', 'C', 'C']), ('CLEAN', ['A', 'B', 'CLEAN', 'A', 'B', 'C', 'C'])],
)
def test_where_the_author_leads_back_to_the_work_the_oracle_recovers_again(after_b, ran):
    trail = Trail()
    held, has_run = stopped(trail, works_on(trail, after_b), flat, while_it_runs, by_operator)
    assert (held.end(), has_run) == ('done', ran)


def test_a_state_of_the_work_that_was_never_executed_is_not_recovered():
    trail = Trail()
    held, has_run = stopped(trail, works_on(trail, 'C'), flat, while_it_runs, by_operator)
    assert (held.end(), has_run) == ('aborted', ['A', 'B', 'C'])
    assert recovers_from_nothing(held)


def test_where_an_operator_sends_the_machine_on_the_oracle_recovers_again():
    trail, gate = Trail(), Gate(heeds=False)
    machine = works_on(trail, 'CLEAN')
    machine._states['CLEAN'] = trail.state('CLEAN', gate)
    with Held(machine) as held:
        while_it_runs(held, 'SM_ROOT')
        held.hand.preempt()
        assert gate.entered.wait(LIMIT_S)
        held.hand.go_to('SM_ROOT', 'C')
        gate.opened.set()
        assert (held.end(), trail.ran) == ('done', ['A', 'B', 'CLEAN', 'C', 'C'])


@pytest.mark.parametrize('preempt', [by_operator, by_script])
@pytest.mark.parametrize('wait', [while_it_runs, while_asked])
@pytest.mark.parametrize('around', [flat, nested, in_a_concurrence])
def test_a_stop_goes_before_a_state_to_which_it_was_to_be_sent(around, wait, preempt):
    trail = Trail()
    works = Gate() if wait is while_it_runs else 'aborted'
    inner = trail.cleaned(trail.state('A'), trail.state('B', works))

    def sent_and_preempted(held):
        held.hand.go_to(around(Trail(), Trail().cleaned())[1], 'A')
        preempt(held)

    held, has_run = stopped(trail, inner, around, wait, sent_and_preempted)
    assert (held.end(), has_run) == ('preempted', ['A', 'B', 'CLEAN'])
    assert not held.of(EventKind.SENT) and not held.hand.status().jumps
    told = [event.text for event in held.of(EventKind.WARNING)]
    assert 'is not sent to A: it was preempted since' in told


@pytest.mark.parametrize('preempt', [by_operator, by_script])
def test_it_does_so_where_the_machine_below_waits_before_a_state(preempt):
    trail = Trail()
    machine = trail.cleaned(trail.cleaned(), trail.state('LAST'), clean=trail.state('STOW'))
    with Held(machine) as held:
        at_a_confirmation(held, 'SM_ROOT/A')
        held.hand.go_to('SM_ROOT', 'B')
        preempt(held)
        assert (held.end(), trail.ran) == ('preempted', ['A', 'CLEAN', 'STOW'])


def test_what_is_asked_for_after_a_stop_is_done():
    trail, gate = Trail(), Gate('preempted', heeds=False)
    machine = works_on(trail, 'CLEAN')
    machine._states['B'] = trail.state('B', gate)
    with Held(machine) as held:
        while_it_runs(held, 'SM_ROOT')
        held.hand.preempt()
        held.hand.go_to('SM_ROOT', 'C')
        gate.opened.set()
        held.end()
    assert (len(held.of(EventKind.SENT)), trail.ran) == (1, ['A', 'B', 'C'])
