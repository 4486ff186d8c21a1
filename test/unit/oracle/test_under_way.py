"""A program that waits for the end of its machine, by `is_running`, in another thread."""

import threading

import pytest
from machines import Scripted, chain_of, watched

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.records.events import EventKind

LIMIT_S = 10.0


class Halt:
    """Something that takes its time."""

    def __init__(self):
        self.reached, self.go = threading.Event(), threading.Event()

    def __call__(self):
        self.reached.set()
        assert self.go.wait(LIMIT_S)
        return 'an id'


@pytest.fixture
def halt():
    halt = Halt()
    yield halt
    halt.go.set()


def runs_at(machine, halt):
    """Execute in another thread. Tells whether it runs at the halt, and after its end."""
    thread = threading.Thread(target=machine.execute, daemon=True)
    thread.start()
    assert halt.reached.wait(LIMIT_S)
    at_halt = machine.is_running()
    halt.go.set()
    thread.join(LIMIT_S)
    return at_halt, machine.is_running()


def test_a_machine_runs_while_the_oracle_begins_its_trial(halt, monkeypatch):
    """So it is before the engine has begun, as when its node is joined or its store opened."""
    machine = watched(Scripted()).machine
    monkeypatch.setattr(OracleContainer, 'new_trial_id', lambda self: halt())
    assert runs_at(machine, halt) == (True, False)


def test_a_machine_runs_until_its_trial_has_ended(halt):
    """A program that ends then has all that its observers write of the trial."""
    machine = watched(Scripted()).machine
    machine.events.observers.append(
        lambda event: halt() if event.kind is EventKind.TRIAL_END else None
    )
    assert runs_at(machine, halt) == (True, False)


def test_a_machine_that_could_not_begin_does_not_run(monkeypatch):
    machine = watched(Scripted()).machine

    def fail(self):
        raise OSError('no id')

    monkeypatch.setattr(OracleContainer, 'new_trial_id', fail)
    with pytest.raises(OSError, match='no id'):
        machine.execute()
    seen = []
    asking = threading.Thread(target=lambda: seen.append(machine.is_running()))
    asking.start()
    asking.join()
    assert seen == [False]


def test_an_own_execute_is_told_of_the_engine_alone():
    """It may refuse to run twice at a time."""
    told = []

    class Own(smach.StateMachine):
        def execute(self, *args):
            told.append(self.is_running())
            outcome = super().execute(*args)
            told.append(self.is_running())
            return outcome

    machine = chain_of(Scripted(), outcomes=('done', 'aborted', 'preempted'))
    machine.__class__ = Own
    assert OracleContainer.wrap(machine).execute() == 'done'
    assert told == [False, False]


def test_an_operator_stops_a_machine_that_is_about_to_begin(halt, monkeypatch):
    asked = []
    machine = watched(
        Scripted(lambda state, userdata: asked.append(state.preempt_requested()) or 'ok')
    ).machine
    monkeypatch.setattr(OracleContainer, 'new_trial_id', lambda self: halt())
    thread = threading.Thread(target=machine.execute, daemon=True)
    thread.start()
    assert halt.reached.wait(LIMIT_S)
    assert OperatorHand(machine).preempt() == 'SM_ROOT is asked to stop'
    halt.go.set()
    thread.join(LIMIT_S)
    assert asked == [True]
