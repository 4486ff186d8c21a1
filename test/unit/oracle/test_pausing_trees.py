"""Paused trees: nested and concurrent machines, and the time limits around what waits."""

from held_machines import Gate, Held
from machines import Scripted, chain_of
from waiting import stays

import smach
from smach_oracle.oracle.records.events import EventKind


def nest(inner: smach.State, after: smach.State) -> smach.StateMachine:
    """A machine of INNER and then AFTER."""
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'AFTER'})
        smach.StateMachine.add('AFTER', after, {'ok': 'done'})
    return machine


def beside(**children: smach.State) -> smach.StateMachine:
    """A machine whose only state runs these side by side."""
    together = smach.Concurrence(['done', 'aborted', 'preempted'], 'done')
    with together:
        for label, child in children.items():
            smach.Concurrence.add(label, child)
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('BOTH', together)
    return machine


def test_a_pause_holds_the_innermost_container_that_comes_to_a_boundary() -> None:
    gate, after = Gate(), Scripted()
    with Held(nest(chain_of(Scripted(gate), Scripted()), after)).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.pause().endswith('runs to its end: A in SM_ROOT/INNER')
        gate.opened.set()
        held.waits_before('SM_ROOT/INNER/B')
        assert held.hand.step() == 'runs now: B in SM_ROOT/INNER'
        held.waits_before('SM_ROOT/AFTER')
        assert after.runs == 0
        held.hand.resume()
        assert held.end() == 'done'


def test_stepping_into_a_nested_machine_waits_before_its_first_state() -> None:
    first = Scripted()
    held = Held(nest(chain_of(first), Scripted()))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/INNER')
        held.hand.step()
        held.waits_before('SM_ROOT/INNER/A')
        assert first.runs == 0


def test_every_branch_of_a_concurrence_waits_and_steps_on_its_own() -> None:
    left, right = Gate(), Gate()
    machine = beside(
        L=chain_of(Scripted(left), Scripted()), R=chain_of(Scripted(right), Scripted())
    )
    with Held(machine).begin() as held:
        assert left.entered.wait(20) and right.entered.wait(20)
        held.hand.pause()
        left.opened.set()
        held.waits_before('SM_ROOT/BOTH/L/B')
        right.opened.set()
        held.waits_before('SM_ROOT/BOTH/L/B', 'SM_ROOT/BOTH/R/B')
        held.hand.step('SM_ROOT/BOTH/R')
        held.waits_before('SM_ROOT/BOTH/L/B')
        assert held.hand.resume() == 'runs now: B in SM_ROOT/BOTH/L'
        assert held.end() == 'done'


def test_a_preempt_ends_every_branch_that_waits_at_once() -> None:
    states = [Scripted(), Scripted()]
    held = Held(beside(L=chain_of(states[0]), R=chain_of(states[1])))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/BOTH')
        held.hand.step()
        held.waits_before('SM_ROOT/BOTH/L/A', 'SM_ROOT/BOTH/R/A')
        held.machine.request_preempt()
        assert held.end() == 'preempted'
    assert [state.runs for state in states] == [0, 0]


def test_a_preempt_ends_a_paused_tree_on_all_levels() -> None:
    """The middle machine would go on to a state of its own once the inner one has obeyed."""
    inner, clean_up = chain_of(Scripted()), Scripted()
    middle = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with middle:
        smach.StateMachine.add('INNER', inner, {'done': 'done', 'preempted': 'CLEAN_UP'})
        smach.StateMachine.add('CLEAN_UP', clean_up, {'ok': 'preempted'})
    held = Held(nest(middle, Scripted()))
    held.hand.set_breakpoint('A')
    with held.begin():
        held.waits_before('SM_ROOT/INNER/INNER/A')
        held.machine.request_preempt()
        assert held.end() == 'preempted'
    assert clean_up.runs == 0


def test_a_branch_that_its_concurrence_stops_does_not_wait_on() -> None:
    gate = Gate()
    waiting = chain_of(
        Scripted(lambda state, ud: 'ok' if gate.entered.wait(20) else 'aborted'), Scripted()
    )
    together = smach.Concurrence(
        ['done', 'aborted', 'preempted'], 'done', child_termination_cb=lambda outcomes: True
    )
    with together:
        smach.Concurrence.add('SHORT', Scripted(gate))
        smach.Concurrence.add('LONG', waiting)
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('BOTH', together, {'done': 'done'})
    held = Held(machine)
    held.hand.set_breakpoint('LONG/B')
    held.hand.set_breakpoint('BOTH/LONG/B')
    with held.begin():
        held.waits_before('SM_ROOT/BOTH/LONG/B')
        gate.opened.set()
        assert held.end() in ('done', 'preempted')
        assert held.hand.status().paused  # that was no wish of the operator's


def test_a_time_limit_around_what_waits_stands_still() -> None:
    held = Held(
        nest(chain_of(Scripted(), Scripted()), Scripted()),
        settings={'states': {'INNER': {'time_limit_s': 1.0}}},
    )
    held.hand.set_breakpoint('INNER/B')
    with held.begin():
        held.waits_before('SM_ROOT/INNER/B')
        assert stays(lambda: held.held() == ['SM_ROOT/INNER/B'], 1.5)
        held.hand.resume()
        assert held.end() == 'done'
    assert not held.of(EventKind.FAILURE)


def test_a_time_limit_runs_on_once_resumed() -> None:
    gate = Gate()
    held = Held(
        nest(chain_of(Scripted(gate)), Scripted()),
        recover=True,
        settings={'states': {'INNER': {'time_limit_s': 1.0}}, 'max_recoveries': 0},
    )
    held.hand.set_breakpoint('INNER/A')
    with held.begin():
        held.waits_before('SM_ROOT/INNER/A')
        held.hand.resume()
        assert gate.entered.wait(20)
        held.end()
    assert [event.state for event in held.of(EventKind.FAILURE)] == ['INNER']


def test_the_minutes_of_the_trial_stand_still() -> None:
    gate = Gate()
    held = Held(
        chain_of(Scripted(), Scripted('aborted')),
        settings={'budget': {'minutes': 1.0 / 60}, 'max_recoveries': 3},
    )
    held.hand.set_breakpoint('B')
    with held.begin():
        held.waits_before('SM_ROOT/B')
        assert stays(lambda: held.held() == ['SM_ROOT/B'], 1.5)
        held.hand.remove_breakpoint('B')
        held.hand.resume()
        assert held.end() == 'done'  # there was time left to recover
    assert not gate.entered.is_set()
    assert len(held.of(EventKind.JUMP)) == 1


def test_a_resume_behind_a_sending_names_each_branch_once() -> None:
    held = Held(beside(L=chain_of(Scripted(), Scripted()), R=chain_of(Scripted())))
    held.hand.pause()
    held.hand.set_autonomy('SM_ROOT/BOTH/R/A', 'confirm')
    with held.begin():
        held.waits_before('SM_ROOT/BOTH')
        held.hand.step()
        held.waits_before('SM_ROOT/BOTH/L/A', 'SM_ROOT/BOTH/R/A')
        held.hand.go_to('SM_ROOT/BOTH/L', 'B')
        said = held.hand.resume()
        assert said == 'runs now: B in SM_ROOT/BOTH/L; still to be confirmed: A in SM_ROOT/BOTH/R'
        held.hand.confirm()
        assert held.end() == 'done'
