"""A pause between the items of an Iterator, and before a precondition."""

import pickle
import threading

import pytest
from held_machines import Gate, Held
from machines import Scripted, chain_of
from test_time_limits import LimitClock
from waiting import stays, wait_for

import smach
from smach_oracle.oracle import OracleContainer, unwrap
from smach_oracle.oracle.records.events import EventKind


def items_machine(state: smach.State) -> smach.StateMachine:
    """A machine whose state EACH does three items with a state."""
    each = smach.Iterator(
        ['done', 'aborted', 'preempted'], [], [], it=[1, 2, 3], exhausted_outcome='done'
    )
    with each:
        smach.Iterator.set_contained_state('ITEM', state, loop_outcomes=['ok'])
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('EACH', each)
    return machine


@pytest.mark.parametrize('nested', [True, False])
def test_an_iterator_waits_between_two_items_and_steps(nested) -> None:
    gate = Gate()
    state = Scripted(gate)
    with Held(items_machine(state), settings={'nested': nested}).begin() as held:
        assert gate.entered.wait(20)
        held.hand.pause()
        gate.opened.set()
        held.waits_before('SM_ROOT/EACH/ITEM')
        assert state.runs == 1
        assert held.hand.step() == 'runs now: ITEM in SM_ROOT/EACH'
        held.waits_before('SM_ROOT/EACH/ITEM')
        assert state.runs == 2
        held.hand.resume()
        assert held.end() == 'done'
    assert state.runs == 3
    assert held.told(EventKind.HOLD_END) == ['stepped', 'resumed']


@pytest.mark.parametrize('nested, runs', [(True, 0), (False, 2)])
@pytest.mark.parametrize(
    'ask', [lambda held: held.hand.preempt(), lambda held: held.machine.request_preempt()]
)
def test_a_preempt_ends_an_iterator_that_waits(ask, nested, runs) -> None:
    def heed(state, ud):
        if state.preempt_requested():
            state.service_preempt()
            return 'preempted'
        return 'ok'

    state = Scripted('ok', heed, heed)
    held = Held(items_machine(state), settings={'nested': nested})
    held.hand.set_breakpoint('ITEM')
    with held.begin():
        held.waits_before('SM_ROOT/EACH/ITEM')
        ask(held)
        assert held.end() == 'preempted'
    assert state.runs == runs  # a state without an oracle of its own runs under the request


def in_a_branch(machine: smach.StateMachine) -> smach.StateMachine:
    """A machine whose state EACH is a Concurrence, with that EACH in its branch."""
    branches = smach.Concurrence(
        ['done', 'aborted', 'preempted'], 'aborted', outcome_map={'done': {'ITEMS': 'done'}}
    )
    with branches:
        smach.Concurrence.add('ITEMS', machine['EACH'])
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('EACH', branches)
    return outer


@pytest.mark.parametrize('nested', [True, False])
@pytest.mark.parametrize(
    'placed, waits_before',
    [(lambda machine: machine, 'EACH/ITEM'), (in_a_branch, 'EACH/ITEMS/ITEM')],
)
def test_the_limit_of_an_iterator_stands_still_while_an_item_waits(
    placed, waits_before, nested, monkeypatch
) -> None:
    clock, over, gate = LimitClock(monkeypatch), threading.Event(), Gate()
    clock.end(1, over)
    limited = {'EACH': {'time_limit_s': 30.0, 'grace_period_s': 5.0}}
    machine = placed(items_machine(Scripted(gate)))
    with Held(machine, settings={'nested': nested, 'states': limited}).begin() as held:
        assert gate.entered.wait(20)
        held.hand.pause()
        gate.opened.set()
        held.waits_before('SM_ROOT/' + waits_before)
        over.set()
        assert wait_for(clock.all_over)
        assert stays(lambda: held.held() == ['SM_ROOT/' + waits_before], 0.1)
        held.hand.resume()
        assert held.end() == 'done'
    assert not held.of(EventKind.FAILURE)


def test_gates_go_with_the_oracle_and_stay_one() -> None:
    machine = items_machine(Scripted())
    for _ in range(2):
        OracleContainer.wrap(machine, nested=False)
        assert machine.execute() == 'done'
    iterator = machine['EACH']
    assert len(iterator._transition_cbs) == 1
    copied = pickle.loads(pickle.dumps(machine))
    gate = copied['EACH']._transition_cbs[0][0]
    assert gate.node.machine is copied
    unwrap(machine)
    assert iterator._transition_cbs == []


def test_an_iterator_that_is_in_another_machine_now_waits_for_that() -> None:
    gate = Gate()
    before = OracleContainer.wrap(items_machine(Scripted(gate)), nested=False)
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('ITS', before['EACH'])
    with Held(machine, settings={'nested': False}).begin() as held:
        assert gate.entered.wait(20)
        held.hand.pause()
        gate.opened.set()
        held.waits_before('SM_ROOT/ITS/ITEM')


def test_a_users_callbacks_stay_beside_a_gate() -> None:
    told = []
    machine = items_machine(Scripted())
    machine['EACH'].register_transition_cb(lambda *args: told.append(len(args)))
    assert machine.execute() == 'done'
    bare = [*told]
    OracleContainer.wrap(machine, nested=False)
    assert [machine.execute(), machine.execute()] == ['done', 'done']
    assert told == bare * 3


def test_an_item_without_an_oracle_of_its_own_is_confirmed_too() -> None:
    state = Scripted()
    settings = {'nested': False, 'autonomy': 'confirm'}
    with Held(items_machine(state), settings=settings).begin() as held:
        held.waits_before('SM_ROOT/EACH')
        held.hand.confirm()
        held.waits_before('SM_ROOT/EACH/ITEM')
        assert state.runs == 1


@pytest.mark.parametrize(
    'settings, waits_before',
    [({}, 'SM_ROOT/A'), ({'states': {'A': {'autonomy': 'confirm'}}}, 'SM_ROOT/A')],
)
def test_a_precondition_is_not_begun_while_held(settings, waits_before) -> None:
    gate = Gate('aborted')
    first, second = Scripted(), Scripted(gate)
    held = Held(chain_of(first, second), settings=settings, preconditions={'B': ['A']})
    by_pause = not settings
    with held.begin():
        if not by_pause:
            held.waits_before(waits_before)
            held.hand.confirm()
        assert gate.entered.wait(20)
        if by_pause:
            held.hand.pause()
        gate.opened.set()
        held.waits_before(waits_before)
        assert first.runs == 1
        assert held.of(EventKind.PRECONDITION_START)
        if by_pause:
            held.hand.resume()
        else:
            held.hand.confirm()
        assert held.end() == 'done'
    assert first.runs >= 2


def test_a_function_among_the_preconditions_waits_too_and_a_preempt_ends_that() -> None:
    def check(ud):
        called.append(1)
        return True

    called = []
    gate = Gate('aborted')
    held = Held(chain_of(Scripted(gate)), preconditions={'A': [check]})
    with held.begin():
        assert gate.entered.wait(20)
        held.hand.pause()
        gate.opened.set()
        held.waits_before('SM_ROOT/check')
        held.machine.request_preempt()
        assert held.end() == 'preempted'
    assert not called


def test_from_before_a_precondition_a_machine_goes_nowhere_else() -> None:
    gate = Gate('aborted')
    first = Scripted()
    held = Held(chain_of(first, Scripted(gate), Scripted()), preconditions={'B': ['A']})
    with held.begin():
        assert gate.entered.wait(20)
        held.hand.pause()
        gate.opened.set()
        held.waits_before('SM_ROOT/A')
        assert held.hand.go_to('', 'C') == 'SM_ROOT goes to C once ORACLE has ended'
        assert stays(lambda: first.runs == 1, 0.3)
        held.hand.resume()
        assert held.end() == 'done'
    assert (first.runs, held.visits()[-1]) == (2, 'C')


def test_a_breakpoint_before_an_item_pauses_the_machine() -> None:
    held = Held(items_machine(Scripted()), settings={'nested': False})
    held.hand.set_breakpoint('ITEM')
    with held.begin():
        held.waits_before('SM_ROOT/EACH/ITEM')
        assert held.hand.status().paused_by == 'breakpoint ITEM'
        held.hand.remove_breakpoint('ITEM')
        held.hand.resume()
        assert held.end() == 'done'


@pytest.mark.parametrize('autonomy', ['run', 'confirm'])
def test_a_state_that_is_given_as_a_precondition_is_held_by_a_pause_alone(autonomy) -> None:
    gate, clear = Gate('aborted'), Scripted()
    held = Held(
        chain_of(Scripted(gate)),
        settings={'states': {'A': {'autonomy': autonomy}}},
        preconditions={'A': [clear]},
    )
    with held.begin():
        if autonomy == 'confirm':
            held.waits_before('SM_ROOT/A')
            held.hand.confirm()
        assert gate.entered.wait(20)
        if autonomy == 'run':
            held.hand.pause()
        gate.opened.set()
        held.waits_before('SM_ROOT/A' if autonomy == 'confirm' else 'SM_ROOT/Scripted')
        assert clear.runs == (autonomy == 'confirm')
        held.hand.confirm() if autonomy == 'confirm' else held.hand.resume()
        assert held.end() == 'done'
    by = [event.by for event in held.of(EventKind.HOLD_START)]
    assert len(by) == (2 if autonomy == 'confirm' else 1)
    assert autonomy == 'run' or by == ['', '']  # no person has held it


def holds_of(held):
    """How often it waits, with a breakpoint before each item."""
    held.hand.set_breakpoint('ITEM')
    held.machine.events.observers.append(
        lambda event: held.hand.resume() if event.kind is EventKind.HOLD_START else None
    )
    assert held.run() == 'done'
    return len(held.of(EventKind.HOLD_START))


@pytest.mark.parametrize('before, now', [(False, True), (True, False), (True, ['OTHER'])])
def test_each_item_is_held_once_whatever_was_nested_before(before, now):
    machine = items_machine(Scripted())
    OracleContainer.wrap(machine, nested=before, strict=False)
    if now is not True:
        unwrap(machine)
    held = Held(machine, nested=now, strict=False)
    assert holds_of(held) == 3


def test_an_iterator_that_is_used_elsewhere_is_held_there_alone():
    first = items_machine(Scripted())
    iterator, second = first['EACH'], smach.StateMachine(['done', 'aborted', 'preempted'])
    with second:
        smach.StateMachine.add('EACH', iterator)
    before, now = Held(first, nested=False), Held(second, nested=False)
    before.hand.pause()
    assert now.begin().end() == 'done' and not now.of(EventKind.HOLD_START)
    assert holds_of(now) == 3
