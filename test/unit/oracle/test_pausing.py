"""Pause, resume, step and preempt of a running machine, and its breakpoints."""

import threading

import pytest
from held_machines import Gate, Held, eventually
from machines import FakeExpert, Scripted, chain_of

import smach
from smach_oracle.oracle.errors import OperatorError
from smach_oracle.oracle.operator_hand import ActiveState
from smach_oracle.oracle.records.events import EventKind


def test_a_pause_lets_the_state_end_and_holds_before_the_next() -> None:
    gate, second = Gate(), Scripted()
    with Held(chain_of(Scripted(gate), second)).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.pause('eva') == 'SM_ROOT is paused; runs to its end: A in SM_ROOT'
        gate.opened.set()
        held.waits_before('SM_ROOT/B')
        assert (second.runs, held.hand.status().paused_by) == (0, 'eva')
        assert held.hand.resume('eva') == 'runs now: B in SM_ROOT'
        assert (held.end(), second.runs) == ('done', 1)
    assert held.told(EventKind.HOLD_START) == ['paused']
    assert held.told(EventKind.HOLD_END) == ['resumed']
    assert [(event.outcome, event.by) for event in held.of(EventKind.OPERATOR_COMMAND)] == [
        ('pause', 'eva'),
        ('resume', 'eva'),
    ]
    assert [event.seq for event in held.events] == list(range(len(held.events)))


def test_the_log_has_each_command_its_effect_and_who_gave_it(log) -> None:
    hand = Held(chain_of(Scripted()), name='TOP').hand
    hand.pause('eva')
    hand.resume()
    assert [text for level, text in log if level == 'info'][-2:] == [
        'TOP: pause by eva: TOP does not run; it will wait before its first state',
        'TOP: resume: TOP does not run; it will not wait',
    ]


def test_a_resume_before_anything_waits_says_what_runs_on() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate), Scripted())).begin() as held:
        assert gate.entered.wait(20)
        held.hand.pause()
        assert held.hand.resume() == (
            'SM_ROOT goes on; nothing has waited for that, and this runs on: A in SM_ROOT'
        )
        gate.opened.set()
        assert held.end() == 'done'
    assert not held.of(EventKind.HOLD_START)


def test_a_machine_that_is_paused_before_it_runs_waits_before_its_first_state() -> None:
    first = Scripted()
    held = Held(chain_of(first))
    assert held.hand.pause() == 'SM_ROOT does not run; it will wait before its first state'
    with held.begin():
        held.waits_before('SM_ROOT/A')
        assert first.runs == 0
        held.hand.resume()
        assert held.end() == 'done'


def test_a_step_enters_one_state_and_waits_again() -> None:
    states = [Scripted(), Scripted(), Scripted()]
    held = Held(chain_of(*states))
    held.hand.pause()
    with held.begin():
        for label, state in zip('ABC', states):
            held.waits_before('SM_ROOT/' + label)
            assert state.runs == 0
            assert held.hand.step() == 'runs now: {} in SM_ROOT'.format(label)
            eventually(lambda state=state: state.runs == 1)
        assert held.end() == 'done'
    assert held.told(EventKind.HOLD_END) == ['stepped'] * 3
    waited_s = [event.data['waited_s'] for event in held.of(EventKind.HOLD_END)]
    assert waited_s == [round(each, 3) for each in waited_s], 'in milliseconds'


def test_a_step_of_a_machine_that_runs_pauses_it() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate), Scripted())).begin() as held:
        assert gate.entered.wait(20)
        with pytest.raises(OperatorError, match='nothing waits. SM_ROOT is paused; runs to'):
            held.hand.step()
        gate.opened.set()
        held.waits_before('SM_ROOT/B')


def test_a_step_of_a_container_that_is_not_there_pauses_nothing() -> None:
    gate = Gate()
    held = Held(chain_of(Scripted(gate), Scripted()))
    with held.begin():
        eventually(gate.entered.is_set)
        with pytest.raises(OperatorError, match="no container 'KITCHEN'; there are: SM_ROOT"):
            held.hand.step('KITCHEN')
        assert not held.hand.status().paused
        gate.opened.set()
        assert held.end() == 'done'


def test_a_preempt_ends_a_paused_machine_at_once() -> None:
    first = Scripted()
    held = Held(chain_of(first))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        assert held.hand.preempt('eva') == 'SM_ROOT is asked to stop'
        assert (held.end(), first.runs) == ('preempted', 0)
        assert not held.hand.status().paused
        assert held.told(EventKind.HOLD_END) == ['preempted']
        held.begin()  # nothing of it is left
        assert (held.end(), first.runs) == ('done', 1)


def test_a_preempt_of_a_paused_machine_that_does_not_run_lifts_the_pause() -> None:
    held = Held(chain_of(Scripted()))
    held.hand.pause()
    assert held.hand.preempt() == 'SM_ROOT does not run; its pause is lifted'
    with held.begin():
        assert held.end() == 'done'


def test_a_preempt_by_somebody_else_leaves_the_pause_to_the_next_trial() -> None:
    first = Scripted()
    held = Held(chain_of(first))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.machine.request_preempt()
        assert held.end() == 'preempted'
        held.begin()
        held.waits_before('SM_ROOT/A')
        held.hand.resume()
        assert (held.end(), first.runs) == ('done', 1)


def test_a_preempt_of_a_state_that_runs_is_passed_on_though_paused() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate), Scripted())).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.status().active == (ActiveState('SM_ROOT', 'A', '', False),)
        held.hand.pause()
        held.hand.preempt()
        assert held.end() == 'preempted'


def test_a_state_that_ignores_a_preempt_is_the_last_while_paused() -> None:
    gate, second = Gate(heeds=False), Scripted()
    with Held(chain_of(Scripted(gate), second)).begin() as held:
        assert gate.entered.wait(20)
        held.hand.pause()
        held.machine.request_preempt()
        gate.opened.set()
        assert (held.end(), second.runs) == ('preempted', 0)


def test_without_an_outcome_for_it_a_preempt_ends_in_a_failing_outcome_unrun() -> None:
    first = Scripted(outcomes=('ok', 'aborted'))
    held = Held(chain_of(first, outcomes=('done', 'aborted')))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.hand.preempt()
        assert (held.end(), first.runs) == ('aborted', 0)


@pytest.mark.parametrize('by_operator', [True, False])
def test_the_author_s_clean_up_is_left_out_while_the_pause_lasts(by_operator) -> None:
    """An operator who preempts lifts the pause; who else preempts leaves it, and nothing moves."""
    gate, clean_up = Gate(), Scripted()
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('WORK', Scripted(gate), {'ok': 'done', 'preempted': 'CLEAN_UP'})
        smach.StateMachine.add('CLEAN_UP', clean_up, {'ok': 'preempted'})
    with Held(machine).begin() as held:
        assert gate.entered.wait(20)
        held.hand.pause()
        if by_operator:
            held.hand.preempt()
        else:
            held.machine.request_preempt()
        assert (held.end(), clean_up.runs) == ('preempted', int(by_operator))
    assert held.hand.status().paused is not by_operator
    assert len(held.of(EventKind.PREEMPT)) == 1


def test_a_machine_that_goes_on_after_a_preempt_is_held_again_but_not_its_clean_up() -> None:
    gate, other = Gate(), Scripted()
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('WORK', Scripted(gate), {'ok': 'done', 'preempted': 'OTHER'})
        smach.StateMachine.add('OTHER', other, {'ok': 'LAST'})
        smach.StateMachine.add('LAST', Scripted(), {'ok': 'done'})
    with Held(
        machine, settings={'autonomy': 'confirm', 'states': {'WORK': {'autonomy': 'run'}}}
    ).begin() as held:
        assert gate.entered.wait(20)
        held.machine.request_preempt()
        held.waits_before('SM_ROOT/LAST')
        assert other.runs == 1
        held.hand.confirm()
        assert held.end() == 'done'


def test_a_breakpoint_pauses_before_its_states_each_time() -> None:
    gate = Gate()
    first, second = Scripted(gate), Scripted('again')
    second._outcomes = set(second._outcomes) | {'again'}
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', first, {'ok': 'PICK_CUP'})
        smach.StateMachine.add('PICK_CUP', second, {'ok': 'done', 'again': 'A'})
    with Held(machine).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.set_breakpoint('PICK_*') == 'SM_ROOT pauses before SM_ROOT/PICK_CUP'
        gate.opened.set()
        for visits in (0, 1):
            eventually(lambda visits=visits: held.held() and second.runs == visits)
            status = held.hand.status()
            assert (status.paused, status.paused_by) == (True, 'breakpoint PICK_*')
            assert held.held() == ['SM_ROOT/PICK_CUP']
            held.hand.resume()
        assert (held.end(), second.runs) == ('done', 2)
    assert held.told(EventKind.HOLD_START) == ['breakpoint', 'breakpoint']


def test_a_breakpoint_that_is_gone_holds_nothing() -> None:
    held = Held(chain_of(Scripted()))
    held.hand.set_breakpoint('SM_ROOT/A')
    assert held.hand.status().breakpoints == ('SM_ROOT/A',)
    held.hand.remove_breakpoint('SM_ROOT/A')
    with held.begin():
        assert held.end() == 'done'
    with pytest.raises(OperatorError, match='there is no breakpoint B; there are: none'):
        held.hand.remove_breakpoint('B')
    held.hand.set_breakpoint('A')
    held.hand.set_breakpoint('C')
    with pytest.raises(OperatorError, match='there is no breakpoint B; there are: A, C'):
        held.hand.remove_breakpoint('B')


def test_a_shutdown_ends_a_pause(monkeypatch) -> None:
    first = Scripted()
    held = Held(chain_of(first))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        assert (held.end(), first.runs) == (None, 0)
    assert held.told(EventKind.HOLD_END) == ['shutdown']


def test_a_paused_machine_steps_alike_where_a_class_steps_it_itself() -> None:
    class Stepper(smach.StateMachine):
        def execute(self, parent_ud=None):
            return super().execute(parent_ud)

    states = [Scripted(), Scripted()]
    held = Held(chain_of(*states, machine_class=Stepper))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.hand.step()
        held.waits_before('SM_ROOT/B')
        held.hand.resume()
        assert held.end() == 'done'


def test_once_resumed_the_machine_takes_the_short_way_again() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate), Scripted(), Scripted())).begin() as held:
        assert gate.entered.wait(20)
        held.hand.pause()
        assert held.machine._oracle.engine.attentive
        gate.opened.set()
        held.waits_before('SM_ROOT/B')
        held.hand.resume()
        assert held.end() == 'done'
        assert not held.machine._oracle.engine.attentive


def test_an_oracle_that_asks_is_no_state_that_runs_to_its_end() -> None:
    def wait(question, cancelled, progress):
        asked.set()
        assert cancelled.wait(20)

    asked = threading.Event()
    with Held(
        chain_of(Scripted('aborted')),
        expert=FakeExpert(wait),
        name='TOP',
        settings={'max_recoveries': 0},
    ).begin() as held:
        assert asked.wait(20)
        assert held.hand.pause() == 'TOP is paused; the oracle is at work in TOP'


def test_a_concurrence_is_no_state_that_runs_to_its_end_where_its_states_do() -> None:
    gate = Gate()
    both = smach.Concurrence(['done', 'aborted', 'preempted'], 'done')
    with both:
        smach.Concurrence.add('INNER', chain_of(Scripted(gate)))
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('BOTH', both)
    with Held(machine, name='TOP').begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.pause() == ('TOP is paused; runs to its end: A in TOP/BOTH/INNER')
        gate.opened.set()


def test_what_an_operator_wants_between_two_trials_is_no_event_of_either() -> None:
    held = Held(chain_of(Scripted()))
    for _ in range(2):
        held.hand.pause('eva')
        held.hand.resume('eva')
        assert not held.of(EventKind.OPERATOR_COMMAND)
        assert held.run() == 'done'
        assert held.events[-1].kind is EventKind.TRIAL_END


def test_a_stop_between_two_trials_holds_nothing_of_the_next() -> None:
    first = Scripted()
    held = Held(chain_of(first))
    held.hand.pause()
    held.hand.preempt()
    held.machine.request_preempt()  # somebody else, whom the state obeys or not
    with held.begin():
        held.end()
    assert first.runs == 1


def test_a_machine_that_is_about_to_end_has_no_active_state() -> None:
    held = Held(chain_of(Scripted()))
    seen = []
    held.machine.register_termination_cb(lambda *args: seen.append(held.hand.status().active))
    assert held.run() == 'done' and seen == [()]


def test_an_exit_while_an_operator_holds_the_machine_ends_the_hold() -> None:
    def interrupt(event):
        if event.kind is EventKind.HOLD_START:
            raise KeyboardInterrupt

    held = Held(chain_of(Scripted()))
    held.hand.pause()
    held.machine.events.observers.append(interrupt)
    with pytest.raises(KeyboardInterrupt):
        held.run()
    assert held.told(EventKind.HOLD_END) == ['stopped'] and not held.held()
