"""Stored trials of machines whose outcomes are numbers, truth values or members of an Enum."""

import enum
import os
import signal
import time

import pytest
from killed_machines import Diary, in_a_process

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.store.store_file import StoreFile


class EndWord(enum.Enum):
    GOOD = 1
    BAD = 2


class EndNumber(int, enum.Enum):
    GOOD = 0
    BAD = 1


NAMES = [
    ('ok', 'aborted'),
    (0, 1),
    (True, False),
    (EndWord.GOOD, EndWord.BAD),
    (EndNumber.GOOD, EndNumber.BAD),
]


class Program:
    """States that note when they begin. In one of them the program dies."""

    def __init__(self, folder, good, bad, dies_in=''):
        self.diary = Diary(str(folder / 'diary'))
        self._store = str(folder / 'robot.db')
        self._outcomes = good, bad
        self._dies_in = dies_in

    def state(self, label):
        def execute(_):
            self.diary.write('begins', label)
            if label == self._dies_in:
                time.sleep(0.2)  # so that all other states have ended
                os.kill(os.getpid(), signal.SIGKILL)
            return self._outcomes[0]

        return smach.CBState(execute, outcomes=list(self._outcomes))

    def chain(self, outcomes=None, **states):
        outcomes = outcomes or self._outcomes
        machine, labels = smach.StateMachine(list(outcomes)), list(states)
        with machine:
            for label, after in zip(labels, [*labels[1:], outcomes[0]]):
                smach.StateMachine.add(label, states[label], {self._outcomes[0]: after})
        return machine

    def run(self, machine):
        """The outcome, None where the program has died, and how often each state has begun."""
        settings = {'checkpoint': self._store, 'on_resume': 'recover'}

        def program():
            return repr(OracleContainer.wrap(machine, name='TOP', settings=settings).execute())

        return in_a_process(program), self.diary.count('begins')


def ends(folder):
    """The outcomes of the stored trials."""
    return [trial.outcome for trial in StoreFile(str(folder / 'robot.db')).trials('TOP')]


def nested(folder, names, dies_in=''):
    program = Program(folder, *names, dies_in)
    inner = program.chain(B=program.state('B'), C=program.state('C'))
    return program.run(program.chain(A=program.state('A'), IN=inner, D=program.state('D')))


@pytest.mark.parametrize('names', NAMES)
@pytest.mark.parametrize('dies_in', ['A', 'C', 'D'])
def test_a_trial_goes_on_where_it_stood(tmp_path, names, dies_in):
    assert nested(tmp_path, names, dies_in)[0] is None
    outcome, begun = nested(tmp_path, names)
    assert outcome == repr(names[0])
    assert begun == {label: 2 if label == dies_in else 1 for label in 'ABCD'}
    assert ends(tmp_path) == [str(names[0])]


class Label(str, enum.Enum):
    """Labels that are text, and say so in words of their own."""

    IN = 'inside'
    FIRST = 'first'
    SECOND = 'second'
    LAST = 'last'


def labelled(folder, dies_in=''):
    program = Program(folder, 'ok', 'aborted', dies_in)
    inner = program.chain(
        **{label: program.state(label.value) for label in (Label.FIRST, Label.SECOND)}
    )
    return program.run(program.chain(**{Label.IN: inner, Label.LAST: program.state('last')}))


@pytest.mark.parametrize('dies_in', ['first', 'second', 'last'])
def test_labels_may_be_members_of_an_enum_of_text(tmp_path, dies_in):
    assert labelled(tmp_path, dies_in)[0] is None
    outcome, begun = labelled(tmp_path)
    assert outcome == "'ok'"
    names = ('first', 'second', 'last')
    assert begun == {label: 2 if label == dies_in else 1 for label in names}


def beside(folder, names, dies_in=''):
    """A Concurrence that ends well where its machines have ended so."""
    program = Program(folder, *names, dies_in)
    both = smach.Concurrence(
        ['done', 'aborted'], 'aborted', outcome_map={'done': dict.fromkeys('LR', names[0])}
    )
    with both:
        for label in 'LR':
            smach.Concurrence.add(label, program.chain(**{label + '1': program.state(label)}))
    top = smach.StateMachine(['done', 'aborted'])
    with top:
        smach.StateMachine.add('BOTH', both)
    return program.run(top)


@pytest.mark.parametrize('names', NAMES)
def test_what_had_ended_in_another_thread_is_not_done_again(tmp_path, names):
    assert beside(tmp_path, names, 'R')[0] is None
    assert beside(tmp_path, names) == ("'done'", {'L': 1, 'R': 2})
