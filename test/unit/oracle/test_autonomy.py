"""The autonomy of states: run, announce, confirm; by settings and at run time."""

from typing import List, Optional

import pytest
from fake_clock import FakeClock
from held_machines import Gate, Held, eventually
from machines import Scripted, chain_of

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.control.control import Control, HeldPlace, LetGo
from smach_oracle.oracle.errors import OperatorError, SettingsError
from smach_oracle.oracle.operator_hand import ActiveState
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.scope.clock import Flag
from smach_oracle.oracle.scope.scope import Reason, Scope
from smach_oracle.oracle.settings.names import PathPattern


def test_a_state_that_is_to_be_confirmed_waits_for_that_alone() -> None:
    second = Scripted()
    held = Held(chain_of(Scripted(), second), settings={'states': {'B': {'autonomy': 'confirm'}}})
    with held.begin():
        held.waits_before('SM_ROOT/B')
        status = held.hand.status()
        assert not status.paused
        assert status.active == (ActiveState('SM_ROOT', 'B', 'confirm', True),)
        assert held.hand.resume() == (
            'SM_ROOT goes on; nothing has waited for that; still to be confirmed: B in SM_ROOT'
        )
        assert second.runs == 0
        assert held.hand.confirm('SM_ROOT', 'eva') == 'runs now: B in SM_ROOT'
        assert held.end() == 'done'
    assert held.told(EventKind.HOLD_END) == ['confirmed']
    assert 0 <= held.of(EventKind.HOLD_END)[0].data['waited_s'] < 20


def test_a_level_is_given_with_a_state() -> None:
    machine = OracleContainer(outcomes=['ok', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add('A', Scripted(), autonomy='confirm')
    held = Held(machine)
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.hand.confirm()
        assert held.end() == 'ok'


def test_a_paused_machine_needs_both() -> None:
    second = Scripted()
    held = Held(chain_of(second), settings={'autonomy': 'confirm'})
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        assert held.hand.status().active == (ActiveState('SM_ROOT', 'A', 'paused', True),)
        assert held.hand.confirm() == 'runs now: A in SM_ROOT once it is resumed'
        assert held.held() == ['SM_ROOT/A']
        held.hand.resume()
        assert held.end() == 'done'


def test_a_step_is_a_confirmation_too() -> None:
    held = Held(chain_of(Scripted(), Scripted()), settings={'autonomy': 'confirm'})
    with held.begin():
        held.waits_before('SM_ROOT/A')
        assert held.hand.step() == 'runs now: A in SM_ROOT'
        held.waits_before('SM_ROOT/B')


def test_a_state_is_announced_before_it_begins(log) -> None:
    held = Held(
        chain_of(Scripted(), Scripted()), settings={'states': {'B': {'autonomy': 'announce'}}}
    )
    with held.begin():
        assert held.end() == 'done'
    kinds = [(event.kind, event.state) for event in held.events]
    assert kinds.index((EventKind.ANNOUNCE, 'B')) + 1 == kinds.index((EventKind.STATE_START, 'B'))
    assert ('info', 'SM_ROOT: is about to enter B') in log
    assert len(held.of(EventKind.ANNOUNCE)) == 1


def test_the_level_can_be_set_while_the_machine_runs() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate), Scripted(), Scripted())).begin() as held:
        assert gate.entered.wait(20)
        held.hand.set_autonomy('**', 'confirm')
        assert held.hand.set_autonomy('SM_ROOT/B', 'run') == 'autonomy run for SM_ROOT/B'
        assert held.hand.status().autonomy == {'**': 'confirm', 'SM_ROOT/B': 'run'}
        gate.opened.set()
        held.waits_before('SM_ROOT/C')
        held.hand.set_autonomy('**', 'run')
        assert held.end() == 'done'
    assert held.told(EventKind.HOLD_END) == ['resumed']


def test_what_was_set_can_be_taken_back() -> None:
    held = Held(chain_of(Scripted()), settings={'autonomy': 'confirm'})
    held.hand.set_autonomy('A', 'run')
    with held.begin():
        assert held.end() == 'done'
    held.hand.set_autonomy('A', '')
    with held.begin():
        held.waits_before('SM_ROOT/A')


def test_a_preempt_ends_a_wait_for_a_confirmation() -> None:
    first = Scripted()
    held = Held(chain_of(first), settings={'autonomy': 'confirm'})
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.machine.request_preempt()
        assert (held.end(), first.runs) == ('preempted', 0)


@pytest.mark.parametrize('states, more', [(9, ''), (10, ''), (11, ', ...')])
def test_at_most_ten_states_are_named(states: int, more: str) -> None:
    held = Held(chain_of(*[Scripted() for _ in range(states)]))
    told = held.hand.set_autonomy('*', 'announce')
    named = ', '.join('SM_ROOT/' + label for label in 'ABCDEFGHIJ'[:states])
    assert told == 'autonomy announce for ' + named + more


def test_a_state_to_be_confirmed_is_confirmed_as_a_precondition_too() -> None:
    look, failing = Scripted(), Scripted('aborted')
    held = Held(
        chain_of(look, failing),
        settings={'states': {'A': {'autonomy': 'confirm'}, 'B': {'preconditions': ['A']}}},
    )
    with held.begin():
        for runs in (0, 1):
            eventually(lambda runs=runs: failing.runs == runs)
            held.waits_before('SM_ROOT/A')
            assert look.runs == runs
            held.hand.confirm()
        assert held.end() == 'done'
    assert (look.runs, failing.runs) == (2, 2)


def test_a_preempt_while_nothing_runs_leaves_the_next_trial_to_be_confirmed() -> None:
    held = Held(
        chain_of(Scripted(), Scripted()), settings={'states': {'B': {'autonomy': 'confirm'}}}
    )
    assert held.hand.preempt() == 'SM_ROOT does not run'
    with held.begin():
        held.waits_before('SM_ROOT/B')
        held.hand.confirm()
        assert held.end() == 'done'


def test_a_state_to_which_the_oracle_goes_is_confirmed_again() -> None:
    first = Scripted('aborted')
    held = Held(chain_of(first), settings={'autonomy': 'confirm'})
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.hand.confirm()
        held.waits_before('SM_ROOT/A')
        assert first.runs == 1
        held.hand.confirm()
        assert (held.end(), first.runs) == ('done', 2)


def test_wrong_levels_and_patterns_are_refused() -> None:
    with pytest.raises(
        SettingsError,
        match="states.A.autonomy: 'never' is not allowed; allowed: run, announce, confirm",
    ):
        Held(chain_of(Scripted()), settings={'states': {'A': {'autonomy': 'never'}}})
    hand = Held(chain_of(Scripted())).hand
    with pytest.raises(OperatorError, match="no autonomy 'full'; allowed: run, announce, confirm"):
        hand.set_autonomy('A', 'full')
    with pytest.raises(OperatorError, match='LABEL or PATH/LABEL'):
        hand.set_breakpoint('')
    with pytest.raises(OperatorError, match='nothing waits for a confirmation'):
        hand.confirm()


def test_a_level_that_is_set_just_before_a_wait_begins_counts() -> None:
    control, place = Control(FakeClock()), HeldPlace('TOP', 'A')
    control.set_level(PathPattern('A'), 'confirm')
    hold = control.hold_before(place, control.level_of(place, 'run') == 'confirm')
    assert hold is not None
    control.set_level(PathPattern('A'), 'run')
    control.begin(hold)
    assert not hold.waits_for_confirmation
    assert control.wait(hold, Scope()) is LetGo.RESUMED


class PassingScope(Scope):
    """Has the time pass for which somebody waits, and notes it."""

    waited: List[float] = []

    def wait(self, seconds: Optional[float] = None, until: Optional[Flag] = None) -> bool:
        """Have it pass."""
        assert seconds is not None and isinstance(self.clock, FakeClock)
        self.waited.append(seconds)
        self.clock.advance(seconds)
        return True


def test_what_waits_while_a_stop_is_under_way_ends_with_it() -> None:
    """It ends when the stop has had its time, and no later."""
    clock = FakeClock()
    control, scope = Control(clock), PassingScope(clock=clock)
    control.pause('eva')
    hold = control.hold_before(HeldPlace('TOP', 'A'), False)
    assert hold is not None
    control.begin(hold)
    with control.stop():
        pass
    began_s = clock.now()
    scope.waited = []
    assert control.wait(hold, scope) is Reason.PREEMPTED
    assert scope.waited == [clock.now() - began_s] and 0.0 < scope.waited[0] < 10.0


def test_after_an_operators_preempt_what_comes_behind_the_clean_up_is_confirmed() -> None:
    gate, tidy, last = Gate(), Scripted(), Scripted()
    machine = smach.StateMachine(['done', 'aborted'])
    with machine:
        smach.StateMachine.add(
            'A',
            Scripted(gate, outcomes=('ok', 'aborted', 'preempted')),
            {'ok': 'B', 'preempted': 'TIDY_UP'},
        )
        smach.StateMachine.add('TIDY_UP', tidy, {'ok': 'B', 'preempted': 'aborted'})
        smach.StateMachine.add('B', last, {'ok': 'done', 'preempted': 'aborted'})
    held = Held(
        machine,
        settings={'states': {'B': {'autonomy': 'confirm'}, 'TIDY_UP': {'autonomy': 'confirm'}}},
    )
    with held.begin():
        eventually(gate.entered.is_set)
        held.hand.preempt()
        held.waits_before('SM_ROOT/B')
        assert (tidy.runs, last.runs) == (1, 0)
        held.hand.confirm()
        assert held.end() == 'done'
