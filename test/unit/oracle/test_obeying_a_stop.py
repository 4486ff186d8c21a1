"""When a container has obeyed a stop, in which of them, and what of its clean-up is held then."""

import threading

import pytest
from guarded_machines import OUTCOMES
from held_machines import LIMIT_S, Gate, Held, Trail, eventually
from machines import FakeExpert, Scripted, Watched, waits
from waiting import wait_for

import smach
from smach_oracle.oracle.control.control import Control
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.scope.clock import Clock

FROM_B = ('ok', 'aborted', 'preempted', 'stopped')


class Ends:
    """What a scripted state does: once it is preempted, it ends so."""

    def __init__(self, outcome='preempted', services=True):
        self.outcome = outcome
        self.services = services
        self.entered = threading.Event()

    def __call__(self, state, ud):
        self.entered.set()
        assert wait_for(state.preempt_requested, LIMIT_S), 'nobody has preempted it'
        if self.services:
            state.service_preempt()
        return self.outcome


def machine_of(outcomes=OUTCOMES, **states):
    """Of states with their transitions."""
    machine = smach.StateMachine(list(outcomes))
    with machine:
        for label, (state, transitions) in states.items():
            smach.StateMachine.add(label, state, transitions)
    return machine


def working(trail, ends, after_b='CLEAN', **clean_up):
    """A, then B, which `ends`, then what is in `clean_up`: labels with their transitions."""
    return machine_of(
        A=(trail.state('A'), {'ok': 'B'}),
        B=(
            trail.state('B', ends, 'ok', outcomes=FROM_B),
            {'ok': 'done', 'preempted': after_b, 'aborted': after_b, 'stopped': after_b},
        ),
        **{label: (trail.state(label), transitions) for label, transitions in clean_up.items()},
    )


def run_and_stop(machine, ends, before=lambda held: None, then=lambda held: None):
    """Execute a machine, preempt it in B, and return it when it has ended."""
    held = Held(machine, settings={'max_recoveries': 9})
    with held:
        before(held)
        held.begin()
        assert ends.entered.wait(LIMIT_S)
        held.hand.preempt()
        then(held)
        eventually(lambda: not held.running())
    return held


@pytest.mark.parametrize(
    'ends',
    [
        Ends('preempted'),
        Ends('preempted', services=False),
        Ends('aborted'),
        Ends('aborted', services=False),
        Ends('stopped'),
    ],
    ids=lambda ends: '{}{}'.format(ends.outcome, '' if ends.services else ', not serviced'),
)
def test_a_state_that_was_stopped_ends_the_work_by_whatever_outcome(ends):
    trail = Trail()
    held = run_and_stop(working(trail, ends, CLEAN={'ok': 'aborted'}), ends)
    assert (held.end(), trail.ran) == ('aborted', ['A', 'B', 'CLEAN'])


def test_clean_ups_on_two_levels_end_the_work():
    trail, ends = Trail(), Ends()
    inner = working(trail, ends, CLEAN={'ok': 'aborted'})
    outer = machine_of(
        N=(inner, {'aborted': 'HOME', 'preempted': 'HOME'}),
        HOME=(trail.state('HOME'), {'ok': 'aborted'}),
    )
    held = run_and_stop(outer, ends)
    assert (held.end(), trail.ran) == ('aborted', ['A', 'B', 'CLEAN', 'HOME'])


def test_a_concurrence_that_ends_by_its_default_has_obeyed_too():
    trail, ends = Trail(), Ends()
    beside = smach.Concurrence(
        ['ok', 'aborted', 'preempted'], 'aborted', outcome_map={'ok': {'LEFT': 'ok', 'RIGHT': 'ok'}}
    )
    with beside:
        smach.Concurrence.add('LEFT', Trail().state('LEFT', ends, 'ok'))
        smach.Concurrence.add('RIGHT', Trail().state('RIGHT', Gate()))
    outer = machine_of(
        A=(trail.state('A'), {'ok': 'C'}),
        C=(beside, {'ok': 'done', 'aborted': 'CLEAN', 'preempted': 'CLEAN'}),
        CLEAN=(trail.state('CLEAN'), {'ok': 'aborted'}),
    )
    held = run_and_stop(outer, ends)
    assert (held.end(), trail.ran) == ('aborted', ['A', 'CLEAN'])


def test_a_clean_up_that_is_stopped_again_and_repeats_itself_is_no_work():
    trail, ends, again = Trail(), Ends(), Ends()
    machine = working(trail, ends, CLEAN={'ok': 'aborted', 'preempted': 'CLEAN'})
    machine._states['CLEAN'] = trail.state('CLEAN', again, 'ok')

    def stop_again(held):
        assert again.entered.wait(LIMIT_S)
        held.hand.preempt()

    held = run_and_stop(machine, ends, then=stop_again)
    assert (held.end(), trail.ran) == ('aborted', ['A', 'B', 'CLEAN', 'CLEAN'])


@pytest.mark.parametrize('fails', ['aborted', 'raises'])
def test_a_branch_that_its_concurrence_ends_is_recovered_as_ever(fails):
    trail, gate = Trail(), Gate()

    def slips(state, ud):
        raise ValueError('slipped')

    left = machine_of(
        WATCH=(trail.state('WATCH', gate), {'ok': 'done', 'preempted': 'UNDOCK'}),
        UNDOCK=(trail.state('UNDOCK', slips if fails == 'raises' else fails, 'ok'), {'ok': 'done'}),
    )
    right = trail.state('CARRY', lambda state, ud: gate.entered.wait(LIMIT_S) and 'ok')
    beside = smach.Concurrence(
        ['done', 'aborted'],
        'aborted',
        outcome_map={'done': {'LEFT': 'done', 'RIGHT': 'ok'}},
        child_termination_cb=lambda outcomes: True,
    )
    with beside:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', right)
    held = Held(machine_of(C=(beside, {'done': 'done'})), settings={'max_recoveries': 9})
    with held.begin():
        eventually(lambda: not held.running())
    assert (held.end(), sorted(trail.ran)) == ('done', ['CARRY', 'UNDOCK', 'UNDOCK', 'WATCH'])


class Unheard(smach.Iterator):
    """A user's own: it passes no preempt on."""

    def request_preempt(self):
        smach.State.request_preempt(self)


def stopped_around(*script):
    """What an inner machine of A and B runs where a container passes no preempt on to it.

    A does what is in the script once the machine around it was asked to stop.
    """
    trail, gate = Trail(), Gate(heeds=False)

    def first(state, ud):
        gate(state, ud)
        return script[0]

    inner = machine_of(
        A=(trail.state('A', first, *script[1:], 'ok'), {'ok': 'B'}),
        B=(trail.state('B'), {'ok': 'done'}),
    )
    each = Unheard(['done', 'aborted', 'preempted'], [], [], [1], 'item', 'done')
    with each:
        smach.Iterator.set_contained_state('ONE', inner, loop_outcomes=['done'])
    with Held(machine_of(ALL=(each, {'done': 'done'}))) as held:
        held.hand.set_breakpoint('B')
        held.begin()
        assert gate.entered.wait(LIMIT_S)
        held.machine.request_preempt()
        gate.opened.set()
        eventually(lambda: not held.running())
    held.end()
    return trail.ran, held


def test_no_breakpoint_holds_a_machine_while_the_one_around_it_is_to_stop():
    ran, held = stopped_around('ok')
    assert ran == ['A', 'B'] and not held.of(EventKind.HOLD_START)


def test_nothing_is_repeated_in_a_machine_while_the_one_around_it_is_to_stop():
    ran, held = stopped_around('aborted')
    assert ran == ['A'] and not held.of(EventKind.DECISION)


def test_a_machine_is_recovered_as_ever_where_a_concurrence_ends_the_one_around_it():
    trail, entered = Trail(), threading.Event()

    def fail(state, ud):
        entered.set()
        assert wait_for(around.preempt_requested, LIMIT_S)
        return 'aborted'

    inner = machine_of(A=(trail.state('A', fail, 'ok'), {'ok': 'done'}))
    each = Unheard(['done', 'preempted'], [], [], [1], 'item', 'done')
    with each:
        smach.Iterator.set_contained_state('ONE', inner, loop_outcomes=['done'])
    around = machine_of(ALL=(each, {'done': 'done'}))
    beside = smach.Concurrence(
        ['done'], 'done', outcome_map={}, child_termination_cb=lambda outcomes: True
    )
    with beside:
        smach.Concurrence.add('LEFT', around)
        right = trail.state('RIGHT', *[lambda state, ud: entered.wait(LIMIT_S) and 'ok'] * 9)
        smach.Concurrence.add('RIGHT', right)
    held = Held(machine_of(C=(beside, {'done': 'done'})))
    with held.begin():
        eventually(lambda: not held.running())
    assert (held.end(), sorted(trail.ran)) == ('done', ['A', 'A', 'RIGHT'])


@pytest.mark.parametrize('services', [True, False])
@pytest.mark.parametrize('hold', ['breakpoint', 'confirm', 'pause'])
def test_the_first_state_of_a_clean_up_is_never_held(services, hold):
    trail, ends = Trail(), Ends(services=services)
    holds = {
        'breakpoint': lambda held: held.hand.set_breakpoint('CLEAN'),
        'confirm': lambda held: held.hand.set_autonomy('CLEAN', 'confirm'),
        'pause': lambda held: None,
    }
    machine = working(trail, ends, CLEAN={'ok': 'preempted'})
    held = Held(machine)
    with held:
        holds[hold](held)
        held.begin()
        assert ends.entered.wait(LIMIT_S)
        if hold == 'pause':
            held.hand.pause()
        held.hand.preempt()
        eventually(lambda: not held.running())
    assert (held.end(), trail.ran) == ('preempted', ['A', 'B', 'CLEAN'])


def in_another(machine):
    return machine_of(N=(machine, {}))


@pytest.mark.parametrize('around', [lambda machine: machine, in_another], ids=['flat', 'nested'])
def test_the_states_behind_it_are_held_again_on_each_level(around):
    trail, ends = Trail(), Ends()
    machine = around(working(trail, ends, CLEAN={'ok': 'WASH'}, WASH={'ok': 'preempted'}))

    def confirm(held):
        eventually(lambda: [each for each in held.held() if each.endswith('/WASH')])
        held.hand.confirm()

    held = run_and_stop(
        machine, ends, lambda held: held.hand.set_autonomy('WASH', 'confirm'), confirm
    )
    assert (held.end(), trail.ran) == ('preempted', ['A', 'B', 'CLEAN', 'WASH'])


@pytest.mark.parametrize('around', [lambda machine: machine, in_another], ids=['flat', 'nested'])
def test_a_machine_on_any_level_that_is_led_back_to_its_work_recovers_again(around):
    trail, ends = Trail(), Ends()
    machine = working(trail, ends, CLEAN={'ok': 'A'})
    machine._states['B'] = trail.state('B', ends, 'aborted', 'ok')
    machine._transitions['B']['aborted'] = 'aborted'
    held = run_and_stop(around(machine), ends)
    assert (held.end(), trail.ran) == ('done', ['A', 'B', 'CLEAN', 'A', 'B', 'B'])


def test_an_operator_sends_a_nested_machine_on_after_a_stop():
    trail, ends, gate = Trail(), Ends(), Gate(heeds=False)
    machine = working(trail, ends, CLEAN={'ok': 'WASH'}, WASH={'ok': 'preempted'}, C={'ok': 'done'})
    machine._states['CLEAN'] = trail.state('CLEAN', gate)

    def send(held):
        assert gate.entered.wait(LIMIT_S)
        held.hand.go_to('SM_ROOT/N', 'C')
        gate.opened.set()

    held = run_and_stop(in_another(machine), ends, then=send)
    assert (held.end(), trail.ran) == ('done', ['A', 'B', 'CLEAN', 'C'])


def test_a_stop_is_not_over_while_its_preempt_is_under_way():
    control = Control(Clock())
    control.pause()
    with control.stop():
        control.stop_is_over()
        assert not control.holds_all


def test_once_a_stop_is_over_a_machine_need_not_look_for_an_operator():
    control = Control(Clock())
    control.pause()
    with control.stop():
        pass
    assert control.is_set, 'it lifts the pause on its way'
    control.stop_is_over()
    assert not control.is_set


def test_a_machine_that_is_entered_for_its_clean_up_is_no_work_though_it_has_run_before():
    trail = Trail()
    inner = machine_of(
        X=(trail.state('X'), {'ok': 'done', 'preempted': 'CLEAN'}),
        CLEAN=(trail.state('CLEAN', 'aborted', 'ok'), {'ok': 'done'}),
    )
    outer = machine_of(
        N=(inner, {'done': 'BACK', 'aborted': 'aborted'}), BACK=(trail.state('BACK'), {'ok': 'N'})
    )
    held = Held(outer, settings={'max_recoveries': 9})
    held.hand.set_breakpoint('BACK')
    with held.begin():
        held.waits_before('SM_ROOT/BACK')
        held.hand.set_breakpoint('N')
        held.hand.resume()
        held.waits_before('SM_ROOT/N')
        held.hand.preempt()
        assert held.end() == 'aborted'
    assert trail.ran == ['X', 'BACK', 'CLEAN']


def test_what_a_machine_has_obeyed_in_an_earlier_trial_counts_no_more():
    def stop(state, ud):
        watched.machine.request_preempt()
        state.service_preempt()
        return 'preempted'

    a, x = Scripted('ok', stop), Scripted(stop, 'aborted')
    inner = machine_of(X=(x, {'ok': 'done'}))
    outer = machine_of(A=(a, {'ok': 'N', 'preempted': 'N'}), N=(inner, {}))
    watched = Watched(outer, settings={'max_recoveries': 9})
    assert [watched.run(), watched.run()] == ['preempted', 'aborted']
    assert (a.runs, x.runs) == (2, 2)


def test_a_preempt_is_not_obeyed_by_what_its_author_drew_after_a_failure():
    """The machine goes on, as it has no other way, and the request stays."""

    def ask(question, cancelled, progress):
        watched.machine.request_preempt()
        return waits(question, cancelled, progress)

    outcomes = ('ok', 'aborted')
    machine = machine_of(
        ('done', 'aborted'),
        A=(Scripted('aborted', outcomes=outcomes), {'ok': 'done', 'aborted': 'B'}),
        B=(Scripted(outcomes=outcomes), {'ok': 'done'}),
    )
    settings = {'max_recoveries': 0, 'author_recoveries': 'override'}
    watched = Watched(machine, expert=FakeExpert(ask), settings=settings)
    assert watched.run() == 'done' and watched.visits() == ['A', 'B']
    assert watched.machine.preempt_requested()
