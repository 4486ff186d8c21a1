"""A question that was open as its program was killed: what it costs of the trial's budget."""

import contextlib
import os

import pytest
from killed_machines import KilledMachine
from killed_trees import flat
from left_stores import Left
from test_never_twice import moment_of

from smach_oracle.oracle import Expert
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.oracle.checkpoint.stored_tree import read_tree
from smach_oracle.store.store_file import StoreFile

ASKS = {'max_recoveries': 0}


def die(*_):
    os.kill(os.getpid(), 9)


def again(question):
    return Answer(AnswerKind.GOTO, state=question.failed_state)


class Says(Expert):
    """A fake expert that writes down the ids of its questions; `give(question)` answers."""

    def __init__(self, folder, give, interface=die):
        self._path, self._give, self._interface = folder / 'asked', give, interface

    def ask(self, question, cancelled, progress):
        with self._path.open('a') as stream:
            stream.write(question.question_id + '\n')
        return self._give(question)

    def run_interface(self, offer, question, cancelled, progress):
        return self._interface(question)


def asked(folder):
    """The numbers of the questions that were put, in all processes."""
    return [int(line.rpartition('-')[2]) for line in (folder / 'asked').read_text().splitlines()]


def tree_of(killed):
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        return read_tree(store, store.trials()[-1].number)


def spent(killed):
    """How many questions of the budget are stored as spent."""
    return tree_of(killed).whole['budget'][1]


@pytest.mark.parametrize('on_resume', ['ask', 'recover'])
@pytest.mark.parametrize('kills', [1, 2])
def test_one_that_is_open_again_is_not_paid_for_again(tmp_path, on_resume, kills):
    settings = {'budget': {'questions': 1}, 'on_resume': on_resume, **ASKS}
    killed = KilledMachine(tmp_path, flat, **settings)
    for _ in range(kills):
        assert killed.run(expert=Says(tmp_path, die)) is None
        assert spent(killed) == 1
    told = killed.run(expert=Says(tmp_path, again))
    assert asked(tmp_path) == [1] * (kills + 1)
    # B, which fails once in each process, fails again: that would be another question
    assert told['outcome'] == 'aborted' and spent(killed) == 1


def test_the_next_failure_costs_the_next_question(tmp_path):
    killed = KilledMachine(tmp_path, flat, budget={'questions': 2}, **ASKS)
    killed.run(expert=Says(tmp_path, die))
    assert killed.run(expert=Says(tmp_path, again))['outcome'] == 'succeeded'
    assert asked(tmp_path) == [1, 1, 2] and spent(killed) == 2


def test_from_an_earlier_moment_it_is_put_again_and_costs_nothing(tmp_path):
    killed = KilledMachine(tmp_path, flat, budget={'questions': 1}, **ASKS)
    killed.run(expert=Says(tmp_path, die))
    moment = moment_of(killed, 'QUERY_OPENED', 'B')
    killed.run(expert=Says(tmp_path, die), resume_from=moment)
    assert asked(tmp_path) == [1, 2] and spent(killed) == 1


# -- answered by an interface

ASSISTED = {
    'budget': {'questions': 1},
    'interfaces': {'assist': {'action': '/assist', 'states': ['B']}},
    **ASKS,
}


def by_interface(question):
    return Answer(AnswerKind.INTERFACE, interface='assist')


def done(question):
    return Answer(AnswerKind.SUPERSEDE, outcome='succeeded')


def test_killed_while_an_interface_runs_it_is_put_again_and_costs_nothing(tmp_path):
    killed = KilledMachine(tmp_path, flat, **ASSISTED)
    assert killed.run(expert=Says(tmp_path, by_interface)) is None
    told = killed.run(expert=Says(tmp_path, by_interface, interface=done))
    assert told['outcome'] == 'succeeded' and told['done'] == ['A', 'B', 'C']
    assert asked(tmp_path) == [1, 2] and spent(killed) == 1


def test_once_an_interface_has_done_the_work_it_is_not_put_again(tmp_path):
    left = Left(flat, expert=Says(tmp_path, by_interface, interface=done), **ASSISTED)
    assert left.told['done'] == ['A', 'B', 'C']
    for point in left.points(left.first_in('C')):
        killed = left.killed_at(point, tmp_path / 'killed')
        assert tree_of(killed).container('TOP').asked == [], point
        told = killed.run(expert=Says(tmp_path, again), max_recoveries=5)
        assert told['outcome'] == 'succeeded' and asked(tmp_path) == [1], point
