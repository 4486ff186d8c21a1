"""What an operator is told of containers that go elsewhere or stop, at any moment of that."""

import threading
from typing import NamedTuple

import pytest
from fake_clock import FakeClock
from held_machines import Gate, Held, eventually
from machines import Scripted, chain_of

import smach
from smach_oracle.oracle import OperatorHand, OracleContainer, unwrap
from smach_oracle.oracle.control.control import Control, Engine, HeldPlace, Jump
from smach_oracle.oracle.errors import OperatorError
from smach_oracle.oracle.execution import trial
from smach_oracle.oracle.records.events import EventKind

OPERATOR_COMMAND = EventKind.OPERATOR_COMMAND
HERE = HeldPlace('TOP', 'A')


class Named(NamedTuple):
    """A fake container."""

    key: str


class OfAMachine(Engine):
    """An engine that nobody asks."""

    attentive = stays_attentive = False


def held_control() -> Control:
    """A container waits before `HERE`."""
    control = Control(FakeClock())
    control.pause('eva')
    hold = control.hold_before(HERE, False)
    assert hold is not None
    control.begin(hold)
    return control


def test_a_container_that_ends_on_its_way_is_no_more_on_its_way() -> None:
    control = held_control()
    control.ask_jump('TOP', Jump('C'))
    control.end(*control._holds)
    assert control.take_jump('TOP') == Jump('C')
    assert control.leave(OfAMachine(), Named('TOP')) is None
    assert control.resume() == () and not control.is_set


def test_a_container_that_ends_before_its_way_tells_where_it_was_to_go() -> None:
    control = Control(FakeClock())
    control.ask_jump('TOP', Jump('C'))
    assert control.is_set
    assert control.leave(OfAMachine(), Named('TOP')) == Jump('C')
    assert not control.is_set


def test_what_was_sent_to_another_container_goes_on_there() -> None:
    control = held_control()
    control.ask_jump('TOP', Jump('B', container='TOP/IN'))

    def arrive() -> None:
        eventually(lambda: not control.paused)
        control.arrived('TOP')

    thread = threading.Thread(target=arrive)
    thread.start()
    assert [each.place for each in control.resume()] == [HeldPlace('TOP/IN', 'B')]
    thread.join()


def test_a_stop_is_not_over_while_it_is_passed_on() -> None:
    control = held_control()
    with control.stop():
        control.stop_is_over()
        assert not control.holds_all


def test_a_stop_is_over_once_a_machine_goes_on() -> None:
    control = held_control()
    with control.stop():
        pass
    assert control.is_set
    for _ in range(2):
        control.stop_is_over()
        assert not control.is_set


@pytest.mark.parametrize('path, may_be_sent', [('TOP', False), ('TOP/IN', True)])
def test_what_is_not_sent_from_where_it_waits_goes_on_there(path: str, may_be_sent: bool) -> None:
    control = held_control()
    control._holds[0].may_be_sent = may_be_sent
    control.ask_jump(path, Jump('C'))
    assert [each.place for each in control.resume()] == [HERE]


class StopsLate(smach.StateMachine):
    """Does something before it passes a preempt on."""

    def request_preempt(self):
        self.userdata.before()
        smach.StateMachine.request_preempt(self)


def test_what_comes_to_its_next_state_while_a_stop_is_on_its_way_is_held() -> None:
    gate, second = Gate(heeds=False), Scripted()
    machine = chain_of(Scripted(gate), second, machine_class=StopsLate)
    held = Held(machine)

    def before() -> None:
        gate.opened.set()
        eventually(lambda: held.of(EventKind.HOLD_START) or second.runs)

    machine.userdata.before = before
    with held.begin():
        eventually(gate.entered.is_set)
        held.hand.pause()
        held.hand.preempt()
        assert (held.end(), second.runs) == ('preempted', 0)


def test_an_operator_has_a_say_in_each_trial() -> None:
    gate, second = Gate(), Scripted()
    held = Held(chain_of(Scripted('ok', gate), second))
    assert held.run() == 'done'
    with held.begin():
        eventually(gate.entered.is_set)
        held.hand.pause()
        gate.opened.set()
        held.waits_before('SM_ROOT/B')
        assert second.runs == 1


@pytest.mark.parametrize('trials', [0, 1])
def test_a_command_as_a_trial_begins_is_no_event_of_it(
    monkeypatch: pytest.MonkeyPatch, trials: int
) -> None:
    held, origin, said = Held(chain_of(Scripted('ok', 'ok'))), trial.origin_of, []
    for _ in range(trials):
        held.run()
    del held.events[:]
    monkeypatch.setattr(
        trial, 'origin_of', lambda settings: said.append(held.hand.resume()) or origin(settings)
    )
    assert held.run() == 'done' and len(said) == 1
    assert [event.seq for event in held.events] == list(range(len(held.events)))
    assert held.events[0].kind is EventKind.TRIAL_START and not held.of(OPERATOR_COMMAND)
    assert held.hand.pause() and not held.of(OPERATOR_COMMAND)  # as between two trials


@pytest.mark.parametrize('nested', [False, True])
def test_a_hand_from_before_holds_a_machine_that_was_wrapped_once_more(nested: bool) -> None:
    gate, inner = Gate(), smach.StateMachine(['done', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('IN', Scripted(gate), {'ok': 'done'})
    machine = smach.StateMachine(['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'B'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'done'})
    OracleContainer.wrap(machine)
    hand = OperatorHand(inner if nested else machine)
    with Held(unwrap(machine)).begin() as held:
        eventually(gate.entered.is_set)
        assert hand.pause('eva') == 'SM_ROOT is paused; runs to its end: IN in SM_ROOT/INNER'
        gate.opened.set()
        held.waits_before('SM_ROOT/B')
        assert hand.status() == held.hand.status()
        hand.resume()
        assert held.end() == 'done'


def test_a_hand_says_that_its_machine_is_under_no_oracle_any_more() -> None:
    held = Held(chain_of(Scripted()))
    hand = held.hand
    unwrap(held.machine)
    for command in (hand.pause, hand.resume, hand.preempt, hand.step, hand.confirm, hand.status):
        with pytest.raises(OperatorError, match='is not under an oracle any more'):
            command()
    assert not hand.send('A', 'eva')  # which is logged
    OracleContainer.wrap(held.machine)
    assert hand.pause() and hand.status().paused


# -- the words of the hand


def test_a_machine_that_was_shut_down_has_no_active_state(monkeypatch: pytest.MonkeyPatch) -> None:
    def shut_down(state, ud):
        monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        return 'ok'

    held = Held(chain_of(Scripted(shut_down), Scripted()))
    assert held.run() is None
    assert held.hand.status().active == ()


def test_a_machine_that_has_no_active_state_is_paused_at_the_next_one() -> None:
    held = Held(chain_of(Scripted()))
    told = []
    held.machine.register_termination_cb(lambda *args: told.append(held.hand.pause()))
    assert held.run() == 'done'
    assert told == ['SM_ROOT is paused; it waits at the next state']


def test_a_state_named_as_the_oracle_of_another_machine_runs_to_its_end() -> None:
    gate, inner = Gate(), smach.StateMachine(['done', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('B', Scripted(), {'ok': 'done'})
    machine = chain_of(Scripted(gate), Scripted())
    with machine:
        smach.StateMachine.add('IN', OracleContainer.wrap(inner, settings={'oracle_label': 'A'}))
    with Held(machine).begin() as held:
        eventually(gate.entered.is_set)
        assert held.hand.pause() == 'SM_ROOT is paused; runs to its end: A in SM_ROOT'


def test_the_settings_say_again_what_an_operator_has_taken_back() -> None:
    hand = Held(chain_of(Scripted())).hand
    assert hand.set_autonomy('A', '') == 'autonomy as the settings say for SM_ROOT/A'


def test_a_refusal_names_the_viewer(log) -> None:
    assert not Held(chain_of(Scripted())).hand.send('NOWHERE', 'eva')
    assert any('is not sent to NOWHERE as eva wants: ' in text for _, text in log)
