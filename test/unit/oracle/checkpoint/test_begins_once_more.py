"""A trial that is interrupted as it begins lets go of its store: the machine can begin again."""

import os
import signal

import pytest
from killed_machines import in_a_process

import smach
from smach_oracle.oracle import OperatorHand, OracleContainer, oracle_of
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.running_goals import GOALS
from smach_oracle.store.store_file import StoreFile

FIRST = (EventKind.TRIAL_START, EventKind.RESUMED)


class Numbered(OracleContainer):
    """Its ids come from `number`, which may raise."""

    def new_trial_id(self):
        return self.number()


class Move(smach.State):
    """Writes down that it has run; may be killed in a process of its own."""

    def __init__(self, name, moved, is_killed=False):
        smach.State.__init__(self, ['succeeded'])
        self._name, self._moved, self._is_killed = name, moved, is_killed

    def execute(self, userdata):
        if self._is_killed:
            os.kill(os.getpid(), signal.SIGKILL)
        self._moved.append(self._name)
        return 'succeeded'


def wrapped(folder, moved, is_killed=False, **settings):
    script = smach.StateMachine(['succeeded'])
    with script:
        smach.StateMachine.add('LOOK', Move('LOOK', moved), {'succeeded': 'MOVE'})
        smach.StateMachine.add('MOVE', Move('MOVE', moved, is_killed))
    machine = Numbered.wrap(
        script,
        name='TOP',
        settings=dict({'checkpoint': str(folder / 'robot.db'), 'on_resume': 'recover'}, **settings),
    )
    machine.number = iter('abcdef').__next__
    return machine


def once(error):
    """A function that raises an error the first time that it is called."""
    errors = [error]

    def raise_once(*_):
        if errors:
            raise errors.pop()

    return raise_once


def no_number(machine, monkeypatch, error):
    fails, number = once(error), machine.number
    machine.number = lambda: fails() or number()


def as_it_tells(machine, monkeypatch, error):
    fails, said = once(error), smach.loginfo
    monkeypatch.setattr(
        smach, 'loginfo', lambda text: fails() if 'a new one begins' in text else said(text)
    )


def as_it_resumes(machine, monkeypatch, error):
    fails, said = once(error), smach.logwarn
    monkeypatch.setattr(smach, 'logwarn', lambda text: fails() if 'goes on' in text else said(text))


def at_its_first_event(machine, monkeypatch, error):
    fails = once(error)
    oracle_of(machine).events.observers.append(
        lambda event: fails() if event.kind in FIRST else None
    )


NEW = [
    (no_number, KeyboardInterrupt()),
    (no_number, OSError('the numbers are not there')),
    (as_it_tells, KeyboardInterrupt()),
    (at_its_first_event, KeyboardInterrupt()),
    (at_its_first_event, SystemExit(3)),
]
RESUMED = [
    (as_it_resumes, KeyboardInterrupt()),
    (as_it_resumes, OSError('the log is full')),
    (at_its_first_event, KeyboardInterrupt()),
]


def interrupted(machine, monkeypatch, interrupt, error):
    """Execute a machine that is interrupted as it begins; return the events that it has told."""
    told = []
    oracle_of(machine).events.observers.append(lambda event: told.append(event.kind.name))
    interrupt(machine, monkeypatch, error)
    observers, watched = list(oracle_of(machine).events.observers), list(GOALS.observers)
    with pytest.raises(type(error)):
        machine.execute()
    assert oracle_of(machine).events.observers == observers and GOALS.observers == watched
    return told


@pytest.mark.parametrize('interrupt, error', NEW)
def test_a_new_trial_can_begin_once_the_reason_is_gone(tmp_path, monkeypatch, interrupt, error):
    moved = []
    machine = wrapped(tmp_path, moved)
    told = interrupted(machine, monkeypatch, interrupt, error)
    assert told == (['TRIAL_START', 'TRIAL_END'] if interrupt is at_its_first_event else [])
    assert not moved
    assert machine.execute() == 'succeeded' and moved == ['LOOK', 'MOVE']
    assert StoreFile(str(tmp_path / 'robot.db'), read_only=True).trials()[-1].ended is not None


@pytest.mark.parametrize('interrupt, error', RESUMED)
@pytest.mark.parametrize('is_earlier', [False, True])
def test_a_resumed_trial_goes_on_from_where_it_would_have(
    tmp_path, monkeypatch, interrupt, error, is_earlier
):
    assert in_a_process(lambda: wrapped(tmp_path, [], is_killed=True).execute()) is None
    store, moved = StoreFile(str(tmp_path / 'robot.db'), read_only=True), []
    (trial,) = store.trials()
    moments = store.moments(trial.number)
    moment = next(each.number for each in moments if each.kind == 'STATE_START')
    store.close()
    machine = wrapped(tmp_path, moved, **({'resume_from': moment} if is_earlier else {}))
    told = interrupted(machine, monkeypatch, interrupt, error)
    assert told == (['RESUMED', 'TRIAL_END'] if interrupt is at_its_first_event else [])
    resumed = []
    oracle_of(machine).events.observers.append(
        lambda event: resumed.append(event) if event.kind is EventKind.RESUMED else None
    )
    assert not moved and machine.execute() == 'succeeded'
    assert moved == (['LOOK', 'MOVE'] if is_earlier else ['MOVE'])
    assert [event.trial_id for event in resumed] == [trial.trial_id]


def test_a_command_as_a_trial_resumes_is_no_event_before_resumed(tmp_path, monkeypatch):
    assert in_a_process(lambda: wrapped(tmp_path, [], is_killed=True).execute()) is None
    machine, told, pressed, said = wrapped(tmp_path, []), [], [], smach.logwarn

    def press(text):
        said(text)
        if 'goes on' in text:
            pressed.append(OperatorHand(machine).resume())

    monkeypatch.setattr(smach, 'logwarn', press)
    oracle_of(machine).events.observers.append(told.append)
    assert machine.execute() == 'succeeded' and len(pressed) == 1
    first = told[0]
    assert first.kind is EventKind.RESUMED and first.seq > first.data['last_seq']
    assert [event.seq - first.seq for event in told] == list(range(len(told)))
