"""An observer that fails is named once, stops nothing, and what it means is said."""

import pytest

import smach
from smach_oracle.oracle import Answer, AnswerKind, Expert, OracleContainer
from smach_oracle.oracle.checkpoint import checkpointer
from smach_oracle.oracle.records.events import EventKind, EventSource, OwnObserver
from smach_oracle.store.state_command import main as oracle_state


def machine_of(runs, *labels, **settings):
    machine = smach.StateMachine(['ok', 'aborted'])
    with machine:
        for label, following in zip(labels, labels[1:] + ('ok',)):
            smach.StateMachine.add(
                label,
                smach.CBState(lambda userdata, label=label: runs(label) or 'ok', outcomes=['ok']),
                {'ok': following},
            )
    return OracleContainer.wrap(machine, name='TOP', settings=settings)


def test_what_is_told_before_the_first_trial_belongs_to_none():
    seen, source = [], EventSource(print)
    source.observers.append(seen.append)
    assert source.last_seq == -1
    source.emit(EventKind.WARNING, 'TOP')
    assert [(event.trial_id, event.seq) for event in seen] == [('', 0)]


class Cancelled(BaseException):
    def __str__(self):
        raise self

    __repr__ = __str__


@pytest.mark.parametrize('error', [ValueError('no'), Cancelled()])
def test_an_observer_that_fails_is_named_once_and_gets_what_follows(log, error):
    seen = []

    def broken(event):
        seen.append(event.seq)
        raise error

    machine = machine_of(lambda label: None, 'A', 'B', 'C')
    machine.events.observers += [broken, lambda event: seen.append(-event.seq)]
    for _ in range(2):
        assert machine.execute() == 'ok'
    assert seen.count(0) == 4 and {4, -4} < set(seen)
    (said,) = [text for level, text in log if level == 'err']
    assert 'broken' in said and 'TRIAL_START of TOP' in said and 'has missed this event' in said


def test_an_observer_whose_class_cannot_be_asked_stops_nothing(log):
    class Hides:
        @property
        def __class__(self):
            raise RuntimeError('no class')

        def __call__(self, event):
            raise ValueError('no')

    machine = machine_of(lambda label: None, 'A')
    machine.events.observers.append(Hides())
    assert machine.execute() == 'ok'
    assert len([text for level, text in log if level == 'err']) == 1


def test_each_observer_that_fails_is_named(log):
    def fails(name):
        def observer(event):
            raise ValueError(name)

        return observer

    machine = machine_of(lambda label: None, 'A')
    machine.events.observers += [fails('one'), fails('two')]
    machine.execute()
    assert len([text for level, text in log if level == 'err']) == 2


def test_what_the_failure_of_one_of_ours_means_is_said(log):
    class Publisher(OwnObserver):
        observer_name, without_it = 'the publisher of ~x', 'consoles miss this event'

        def on_event(self, event):
            raise OSError('gone')

    machine = machine_of(lambda label: None, 'A')
    machine.events.observers.append(Publisher().on_event)
    machine.execute()
    (said,) = [text for level, text in log if level == 'err']
    assert 'the publisher of ~x failed at' in said and 'consoles miss this event' in said


def test_ctrl_c_in_an_observer_ends_the_program():
    def stop(event):
        if event.kind is EventKind.STATE_START:
            raise KeyboardInterrupt

    machine = machine_of(lambda label: None, 'A')
    machine.events.observers.append(stop)
    with pytest.raises(KeyboardInterrupt):
        machine.execute()


class Person(Expert):
    def __init__(self):
        self.asked = []

    def ask(self, question, cancelled, progress):
        self.asked.append(question.failed_state)
        return Answer(AnswerKind.GOTO, state='C', by='ann')


def test_after_a_fault_of_the_store_a_person_says_how_the_trial_goes_on(
    tmp_path, log, monkeypatch, capsys
):
    """Otherwise the machine would go back to where the store was written last."""
    begun = []

    def killed(label):
        begun.append(label)
        if begun == ['A', 'B', 'C']:
            raise KeyboardInterrupt

    whole = checkpointer.Checkpointer._where

    def broken(self, event, node):
        if event.state == 'B':
            raise ZeroDivisionError('a fault of ours')
        return whole(self, event, node)

    monkeypatch.setattr(checkpointer.Checkpointer, '_where', broken)
    store = str(tmp_path / 'robot.db')
    with pytest.raises(KeyboardInterrupt):
        machine_of(killed, 'A', 'B', 'C', checkpoint=store).execute()
    monkeypatch.undo()
    (said,) = [text for level, text in log if level == 'err']
    assert 'this trial is not stored any more' in said and 'ZeroDivisionError: a fault' in said
    assert oracle_state([store]) == 0
    assert 'not stored to its end, last: TOP/' in capsys.readouterr().out
    del begun[:]
    person = Person()
    machine = machine_of(begun.append, 'A', 'B', 'C', checkpoint=store, on_resume='recover')
    machine = OracleContainer.wrap(
        machine, name='TOP', expert=person, settings={'checkpoint': store, 'on_resume': 'recover'}
    )
    assert machine.execute() == 'ok'
    assert len(person.asked) == 1 and begun == ['C']


def test_a_trial_that_ends_after_a_fault_of_the_store_is_over(tmp_path, log, monkeypatch):
    def broken(self, event, node):
        raise ZeroDivisionError

    monkeypatch.setattr(checkpointer.Checkpointer, '_where', broken)
    store = str(tmp_path / 'robot.db')
    for _ in range(2):
        begun = []
        assert machine_of(begun.append, 'A', 'B', checkpoint=store).execute() == 'ok'
        assert begun == ['A', 'B']


def test_before_the_first_event_the_number_of_the_last_one_is_below_0():
    machine = machine_of(lambda label: None, 'LOOK')
    assert machine.events.last_seq == -1
    seen = []
    machine.events.observers.append(seen.append)
    machine.execute()
    assert machine.events.last_seq == seen[-1].seq == len(seen) - 1
