"""A running machine that an operator sends to a state, with the checks of an expert's jump."""

import threading
from typing import Any

import pytest
from guarded_machines import both, chain
from held_machines import Gate, Held, eventually
from machines import FakeExpert, Scripted, chain_of, contents, goto

import smach
from smach_oracle.oracle.control.control import Jump
from smach_oracle.oracle.errors import OperatorError
from smach_oracle.oracle.records.events import EventKind


def test_it_goes_there_once_its_state_has_ended() -> None:
    gate, second, third = Gate(), Scripted(), Scripted()
    with Held(chain_of(Scripted(gate), second, third)).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.go_to('', 'C', 'eva') == 'SM_ROOT goes to C once A has ended'
        assert held.hand.status().jumps == {'SM_ROOT': 'C'}
        gate.opened.set()
        assert (held.end(), second.runs, third.runs) == ('done', 0, 1)
        assert held.hand.status().jumps == {}
    (sent,) = held.of(EventKind.SENT)
    assert (sent.state, sent.target, sent.by) == ('B', 'C', 'eva')
    assert sent.data == {'missing_keys': [], 'userdata': 'keep'}
    assert not held.of(EventKind.JUMP, EventKind.FAILURE)


@pytest.mark.parametrize('by, named', [('eva', 'eva'), ('', 'an operator')])
def test_the_log_says_who_has_sent_it(by: str, named: str, log: Any) -> None:
    held = Held(chain_of(Scripted(), Scripted()))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.hand.go_to('', 'B', by)
        held.waits_before('SM_ROOT/B')
    assert ('info', "State machine sent by {} to 'B' instead of 'A'".format(named)) in log


def test_a_paused_machine_goes_there_at_once_and_waits_there() -> None:
    states = [Scripted(), Scripted(), Scripted()]
    held = Held(chain_of(*states))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        assert held.hand.go_to('SM_ROOT', 'C') == 'SM_ROOT goes to C instead of A, where it waits'
        held.waits_before('SM_ROOT/C')
        assert held.hand.resume() == 'runs now: C in SM_ROOT'
        assert held.end() == 'done'
    assert [state.runs for state in states] == [0, 0, 1]
    assert held.told(EventKind.HOLD_END) == ['sent', 'resumed']


def test_a_nested_machine_can_be_sent_and_a_later_wish_wins() -> None:
    gate = Gate()
    states = [Scripted(), Scripted(), Scripted()]
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', chain_of(Scripted(gate), *states))
    with Held(machine).begin() as held:
        assert gate.entered.wait(20)
        held.hand.go_to('SM_ROOT/INNER', 'C')
        held.hand.go_to('/SM_ROOT/INNER/', 'D')
        gate.opened.set()
        assert held.end() == 'done'
    assert [state.runs for state in states] == [0, 0, 1]


def test_it_is_refused_what_an_expert_is_refused() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate), Scripted())).begin() as held:
        assert gate.entered.wait(20)
        with pytest.raises(OperatorError, match="no state 'X' to go to; allowed: A, B$"):
            held.hand.go_to('', 'X')
        with pytest.raises(OperatorError, match="no state 'ORACLE' to go to"):
            held.hand.go_to('', 'ORACLE')
        with pytest.raises(OperatorError, match="no container 'SM_ROOT/Y'; there are: SM_ROOT$"):
            held.hand.go_to('SM_ROOT/Y', 'A')
        assert not held.hand.status().jumps


@pytest.mark.parametrize('of_b', [{}, {'on_retry': 'confirm'}])
def test_a_blocked_state_is_refused(of_b) -> None:
    gate = Gate(heeds=False)
    held = Held(
        chain_of(Scripted(gate), Scripted('aborted')),
        settings={
            'states': {'A': {'time_limit_s': 0.1, 'grace_period_s': 0.05}, 'B': of_b},
            'max_recoveries': 0,
        },
        expert=FakeExpert(goto('B')),
    )
    held.hand.set_breakpoint('B')
    with held.begin():
        held.waits_before('SM_ROOT/B')
        with pytest.raises(OperatorError, match='A cannot be entered now: still runs'):
            held.hand.go_to('', 'A')
        gate.opened.set()


def test_a_state_that_is_blocked_once_the_jump_is_due_is_not_entered() -> None:
    gate = Gate(heeds=False)
    held = Held(
        chain_of(Scripted(gate), Scripted()),
        settings={
            'states': {'A': {'time_limit_s': 0.3, 'grace_period_s': 0.05}},
            'max_recoveries': 0,
        },
        expert=FakeExpert(goto('B')),
    )
    with held.begin():
        assert gate.entered.wait(20)
        assert held.hand.go_to('', 'A') == 'SM_ROOT goes to A once A has ended'
        assert held.end() == 'done'
        gate.opened.set()
    assert not held.of(EventKind.SENT)
    told = [event.text for event in held.of(EventKind.WARNING)]
    assert any(
        each.startswith('is not sent to A: A cannot be entered now: still runs') for each in told
    ), told


def test_missing_keys_are_told_before() -> None:
    gate = Gate()
    machine = chain_of(Scripted(gate), Scripted(), Scripted(input_keys=['cup']))
    with Held(machine).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.go_to('', 'C').endswith('; without its input keys cup')
        assert 'input keys' not in held.hand.go_to('', 'C', written=['cup'])
        held.hand.go_to('', 'C')
        gate.opened.set()
        assert held.end() == 'done'
    assert held.of(EventKind.SENT)[0].data['missing_keys'] == ['cup']
    assert held.of(EventKind.WARNING)[0].text == 'sent there without its input keys cup'


def test_a_state_that_is_not_repeated_by_itself_has_to_be_confirmed() -> None:
    gate, first = Gate(), Scripted()
    held = Held(
        chain_of(first, Scripted(gate), Scripted()),
        settings={'states': {'A': {'on_retry': 'confirm'}}},
    )
    with held.begin():
        assert gate.entered.wait(20)
        with pytest.raises(OperatorError, match='going to A may repeat A: confirm that it may'):
            held.hand.go_to('', 'A')
        assert held.hand.go_to('', 'A', confirm_repeats=True).endswith('; it may repeat A')
        gate.opened.set()
        assert (held.end(), first.runs) == ('done', 2)


def test_what_comes_to_be_repeated_in_between_is_not_confirmed() -> None:
    """B was not done when the jump was asked for; it was when it was to be made."""
    gate = Gate()
    states = [Scripted(gate), Scripted(), Scripted()]
    held = Held(chain_of(*states), settings={'states': {'A': {'on_retry': 'confirm'}}})
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        control = held.machine._oracle.tree.control
        held.hand.step()
        assert gate.entered.wait(20)
        control.ask_jump('SM_ROOT', Jump('A', 'eva'))  # as if it were asked before A began
        gate.opened.set()
        held.waits_before('SM_ROOT/B')
        held.hand.resume()
        assert held.end() == 'done'
    assert states[0].runs == 1
    assert 'is not sent to A: it may repeat A, which nobody has confirmed' in [
        event.text for event in held.of(EventKind.WARNING)
    ]


def test_userdata_are_as_the_state_had_them_unless_settings_keep_them() -> None:
    for userdata, seen in (('restore', [1, 1]), ('keep', [1, 2])):
        values = []

        def first(state, ud, values=values):
            values.append(ud.x)
            ud.x = ud.x + 1
            return 'ok'

        machine = chain_of(Scripted(first, first, input_keys=['x'], output_keys=['x']), Scripted())
        machine.userdata.x = 1
        held = Held(machine, settings={'userdata': userdata})
        held.hand.set_breakpoint('B')
        with held.begin():
            held.waits_before('SM_ROOT/B')
            held.hand.remove_breakpoint('B')
            held.hand.go_to('', 'A')
            held.waits_before('SM_ROOT/A')
            held.hand.resume()
            assert held.end() == 'done'
        assert values == seen
        assert held.of(EventKind.SENT)[0].data['userdata'] == userdata
        assert contents(held.machine.userdata)['x'] == seen[-1] + 1


def test_a_state_that_was_not_entered_after_all_is_the_authors_the_next_time() -> None:
    """The oracle would have entered A, and a person would be asked why it still runs."""
    gate, expert = Gate(), FakeExpert()

    def pauses(state: Any, ud: Any) -> str:
        held.hand.pause()
        return 'aborted'

    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Scripted(pauses, gate), {'ok': 'done'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'A'})
    held = Held(
        machine, expert=expert, settings={'still_running_s': 0.05, 'still_running_factor': 1}
    )
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.hand.go_to('', 'B')
        held.hand.resume()
        eventually(gate.entered.is_set)
        assert not gate.opened.wait(0.3)  # six times as long as it takes to ask
        gate.opened.set()
        assert held.end() == 'done'
    assert expert.questions == []


def test_a_container_that_ends_before_says_so() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate))).begin() as held:
        assert gate.entered.wait(20)
        held.hand.go_to('', 'A')
        gate.opened.set()
        assert held.end() == 'done'
    assert [event.text for event in held.of(EventKind.WARNING)] == [
        'has ended before it could be sent to A'
    ]
    assert not held.hand.status().jumps


def test_a_machine_that_does_not_run_begins_there() -> None:
    states = [Scripted(), Scripted()]
    held = Held(chain_of(*states))
    assert held.hand.go_to('', 'B') == 'SM_ROOT does not run; it will begin in B'
    with held.begin():
        assert held.end() == 'done'
    assert [state.runs for state in states] == [0, 1]


def test_each_branch_of_a_concurrence_can_be_meant() -> None:
    held = Held(chain(BOTH=both(LEFT=Scripted(), RIGHT=Scripted())))
    for label in ('LEFT', 'RIGHT'):
        told = 'SM_ROOT/BOTH does not run; it will begin in ' + label
        assert held.hand.go_to('SM_ROOT/BOTH', label) == told


def test_once_sent_the_machine_takes_the_short_way_again() -> None:
    gate = Gate()
    with Held(chain_of(Scripted(gate), Scripted(), Scripted(), Scripted())).begin() as held:
        assert gate.entered.wait(20)
        held.hand.go_to('', 'C')
        gate.opened.set()
        assert held.end() == 'done'
        assert not held.machine._oracle.engine.attentive


def test_what_waits_in_another_branch_does_not_wait_here() -> None:
    # who is held first holds the other before its first state, too
    def wait_for_a(state: Any, ud: Any) -> str:
        assert gate.entered.wait(20)
        return 'ok'

    gate, there = Gate(), Scripted()
    machine = chain(
        BOTH=both(
            HELD=chain(W=Scripted(wait_for_a), H=Scripted()),
            RUNS=chain(A=Scripted(gate), B=Scripted(), C=there),
        )
    )
    held = Held(machine)
    held.hand.set_breakpoint('H')
    with held.begin():
        assert gate.entered.wait(20)
        held.waits_before('SM_ROOT/BOTH/HELD/H')
        said = held.hand.go_to('SM_ROOT/BOTH/RUNS', 'C')
        assert said == 'SM_ROOT/BOTH/RUNS goes to C once A has ended'
        held.hand.remove_breakpoint('H')
        gate.opened.set()
        held.hand.resume()
        assert (held.end(), there.runs) == ('done', 1)


def test_a_machine_whose_expert_is_asked_goes_there_after_the_answer() -> None:
    def wait_and_go(question, cancelled, progress):
        assert asked.opened.wait(20)
        return goto('A')

    asked, first, last = Gate(), Scripted('aborted'), Scripted()
    held = Held(
        chain_of(first, Scripted(), last),
        expert=FakeExpert(wait_and_go),
        settings={'max_recoveries': 0},
    )
    with held.begin():
        eventually(lambda: held.of(EventKind.QUERY_OPENED))
        assert held.hand.go_to('', 'C') == 'SM_ROOT goes to C once ORACLE has ended'
        asked.opened.set()
        assert (held.end(), first.runs, last.runs) == ('done', 1, 1)


def test_a_preempt_comes_before_a_jump() -> None:
    gate, third = Gate(), Scripted()
    with Held(chain_of(Scripted(gate), Scripted(), third)).begin() as held:
        assert gate.entered.wait(20)
        held.hand.go_to('', 'C')
        held.hand.preempt()
        assert (held.end(), third.runs) == ('preempted', 0)
    assert not held.of(EventKind.SENT)


def test_it_can_be_sent_into_the_middle_of_a_machine_that_does_not_run() -> None:
    gate, look, aim = Gate(), Scripted(), Scripted()
    between = Scripted()
    machine = chain(FIRST=Scripted(gate), BETWEEN=between, SEE=chain(ARM=chain(AIM=aim, LOOK=look)))
    with Held(machine).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.go_to('SM_ROOT/SEE/ARM', 'LOOK', 'eva') == (
            'SM_ROOT goes to SM_ROOT/SEE/ARM/LOOK once FIRST has ended'
        )
        assert held.hand.status().jumps == {'SM_ROOT': 'SM_ROOT/SEE/ARM/LOOK'}
        gate.opened.set()
        assert held.end() == 'done'
    assert (between.runs, aim.runs, look.runs) == (0, 0, 1)
    (sent,) = held.of(EventKind.SENT)
    assert (sent.path, sent.state, sent.target) == ('SM_ROOT', 'BETWEEN', 'SEE')
    assert sent.data['to'] == 'SM_ROOT/SEE/ARM/LOOK'
    assert held.machine.execute() == 'done' and aim.runs == 1, 'later it begins at its own start'


def test_a_paused_machine_goes_into_another_container_and_waits_on_the_way() -> None:
    held = Held(chain(FIRST=Scripted(), SEE=chain(AIM=Scripted(), LOOK=Scripted())))
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/FIRST')
        assert held.hand.go_to('SM_ROOT/SEE', 'LOOK') == (
            'SM_ROOT goes to SM_ROOT/SEE/LOOK instead of FIRST, where it waits'
        )
        held.waits_before('SM_ROOT/SEE')
        held.hand.step()
        held.waits_before('SM_ROOT/SEE/LOOK')
        held.hand.resume()
        assert held.end() == 'done'


def test_a_jump_into_another_container_has_the_checks_of_an_experts_jump() -> None:
    gate = Gate()
    pour = Scripted()
    machine = chain(
        SEE=chain(POUR=pour, LOOK=Scripted(input_keys=['lamp'])),
        WAIT=Scripted(gate),
        LAST=Scripted(),
    )
    held = Held(machine, settings={'states': {'POUR': {'on_retry': 'confirm'}}})
    with held.begin():
        assert gate.entered.wait(20)
        with pytest.raises(OperatorError, match='may repeat SEE/POUR: confirm that it may'):
            held.hand.go_to('SM_ROOT/SEE', 'POUR')
        assert held.hand.go_to('SM_ROOT/SEE', 'LOOK', confirm_repeats=True).endswith(
            '; without its input keys lamp; it may repeat SEE/POUR'
        )
        held.hand.go_to('SM_ROOT/SEE', 'POUR', confirm_repeats=True)
        gate.opened.set()
        assert held.end() == 'done'
    assert pour.runs == 2


@pytest.mark.parametrize(
    'command, told',
    [
        ('resume', 'runs now: C in SM_ROOT'),
        ('step', 'runs now: C in SM_ROOT'),
        ('confirm', 'runs now: C in SM_ROOT once it is resumed'),
    ],
)
def test_a_command_right_after_a_jump_finds_what_waits_where_it_leads(command, told) -> None:
    """The machine is on its way meanwhile: a callback of its author's takes its time."""
    on_its_way, let_go = threading.Event(), threading.Event()

    def callback(userdata, active, *args) -> None:
        if active == ['C']:
            on_its_way.set()
            assert let_go.wait(20)

    machine = chain_of(Scripted(), Scripted(), Scripted())
    machine.register_transition_cb(callback)
    held = Held(
        machine, settings={'states': {'C': {'autonomy': 'confirm'}}} if command == 'confirm' else {}
    )
    held.hand.pause()
    with held.begin():
        held.waits_before('SM_ROOT/A')
        held.hand.go_to('', 'C')
        assert on_its_way.wait(20)
        threading.Timer(0.05, let_go.set).start()  # no command tells that it has begun to wait
        assert getattr(held.hand, command)() == told
        held.hand.resume()
        assert held.end() == 'done'
