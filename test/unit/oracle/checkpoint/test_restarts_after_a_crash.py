"""The policy `restart` after a crash: the userdata of the start, and the number of restarts."""

import contextlib
import os
import sqlite3

import pytest
from killed_machines import KilledMachine, Noted
from killed_trees import ENDS
from left_stores import Left
from test_never_twice import oracle_state
from test_unanswered import Answers, same_state

import smach
from smach_oracle.oracle.checkpoint.container_facts import start_facts
from smach_oracle.oracle.checkpoint.stored_tree import read_tree
from smach_oracle.store.store_file import StoreFile

RESTART = {
    'policy': {'name': 'restart', 'times': 3},
    'on_resume': 'recover',
    'deep_copy_keys': ['cups'],
}


class Unknown:
    """Of a class that has no codec."""

    is_there = True


class Adds(smach.State):
    """Adds one to a number, and a cup to a list in place. Writes down how many there are then."""

    def __init__(self, key, diary, points, others=()):
        smach.State.__init__(self, ['succeeded'], [key, 'cups', *others], [key])
        self._key, self._diary, self._points, self._others = key, diary, points, others

    def execute(self, userdata):
        self._points()
        assert all(userdata[other].is_there for other in self._others)
        userdata[self._key] += 1
        userdata.cups.append('full')
        seen = '{}={},cups={}'.format(self._key, userdata[self._key], len(userdata.cups))
        self._diary.write('sees', seen)
        self._points()
        return 'succeeded'


def counting(number=0, others=()):
    """N counts from `number`, and reads other keys. M counts in a container. B fails once.

    The container has userdata of its own.
    """

    def build(diary, points):
        inner = smach.StateMachine(['succeeded'], ['cups'])
        inner.userdata.m = 0
        with inner:
            smach.StateMachine.add('M', Adds('m', diary, points))
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.n, machine.userdata.cups, machine.userdata.done = number, [], []
        for other in others:
            machine.userdata[other] = Unknown()
        with machine:
            smach.StateMachine.add('N', Adds('n', diary, points, others), {'succeeded': 'IN'})
            smach.StateMachine.add('IN', inner, {'succeeded': 'B'})
            smach.StateMachine.add('B', Noted('B', diary, points, failures=1), ENDS)
        return machine

    return build


def facts_of(killed, words):
    """The names of stored facts that begin with one of these words."""
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        names = {each.name for each in store.facts(1)}
    return sorted(each for each in names if each.startswith(words))


def tree_of(killed):
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        return read_tree(store, 1)


def test_killed_anywhere_it_starts_over_with_the_userdata_of_the_start(tmp_path):
    left = Left(counting(), **RESTART)
    assert left.told['outcome'] == 'succeeded'
    for point in left.points():
        killed = left.killed_at(point, tmp_path / 'killed')
        told = killed.run()
        assert told['outcome'] == 'succeeded', (point, told)
        assert set(killed.diary.count('sees')) == {'n=1,cups=1', 'm=1,cups=2'}, point


def killed_in_b(folder, build, **settings):
    """Killed while B runs for the second time, after a restart."""
    left = Left(build, **dict(RESTART, **settings))
    return left.killed_at(left.first_in('B', times=2), folder)


def test_the_userdata_of_the_start_are_not_those_that_the_script_gives_now(tmp_path):
    killed_in_b(tmp_path / 'killed', counting(10))
    killed = KilledMachine(tmp_path / 'killed', counting(20), **RESTART)
    assert killed.run()['outcome'] == 'succeeded'
    assert set(killed.diary.count('sees')) == {'n=11,cups=1', 'm=1,cups=2'}


@pytest.mark.parametrize('kill_at, sees', [(1, 'n=21'), (2, 'n=21'), (3, 'n=11')])
def test_stopped_before_its_first_state_it_has_those_with_which_that_begins(
    tmp_path, kill_at, sees
):
    """A callback of the start may give them."""

    def beginning_with(number):
        def build(diary, points):
            machine = counting()(diary, points)
            machine.register_start_cb(lambda userdata, _: setattr(userdata, 'n', number))
            return machine

        return build

    settings = dict(RESTART, on_resume='ask')
    assert KilledMachine(tmp_path, beginning_with(10), **settings).run(kill_at=kill_at) is None
    killed = KilledMachine(tmp_path, beginning_with(20), **settings)
    told = killed.run(expert=Answers(tmp_path / 'asked', same_state))
    assert told['outcome'] == 'succeeded' and 'JUMP' in [kind for kind, _, _ in told['events']]
    assert set(killed.diary.count('sees')) == {sees + ',cups=1', 'm=1,cups=2'}


def test_a_key_that_cannot_be_stored_has_the_value_of_the_script(tmp_path):
    killed = killed_in_b(tmp_path / 'killed', counting(others=['camera']))
    assert facts_of(killed, 'start:') == ['start:cups', 'start:done', 'start:m', 'start:n']
    assert killed.run()['outcome'] == 'succeeded'


def test_a_key_whose_name_is_no_text_is_not_stored():
    facts = start_facts('TOP', {'\udc80': 1, 'n': 2})
    assert [each.name for each in facts] == ['start:n']


def test_what_somebody_has_edited_outlives_a_restart(tmp_path):
    killed = killed_in_b(tmp_path / 'killed', counting())
    oracle_state(killed, 'edit', 'n=100')
    assert killed.run()['outcome'] == 'succeeded'
    assert [each for each in killed.diary.count('sees') if each.startswith('n=101')]


@pytest.mark.parametrize('times', [1, 3])
def test_how_often_it_has_started_over_is_stored(tmp_path, times):
    policy = {'name': 'restart', 'times': times}
    killed = killed_in_b(tmp_path / 'killed', counting(), policy=policy)
    assert tree_of(killed).whole['restarts'] == 1
    told = killed.run()
    assert told['outcome'] == ('succeeded' if times > 1 else 'aborted')
    assert any('starting over' in line for line in told['log']) == (times > 1)
    assert tree_of(killed).whole['restarts'] == times


class Dies(smach.State):
    """Takes the process down, each time."""

    def __init__(self, diary):
        smach.State.__init__(self, ['succeeded', 'aborted'])
        self._diary = diary

    def execute(self, userdata):
        self._diary.write('begins', 'DIES')
        os.kill(os.getpid(), 9)


def test_a_state_that_takes_the_process_down_is_not_started_over_without_end(tmp_path):
    def build(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            smach.StateMachine.add('DIES', Dies(diary), ENDS)
        return machine

    killed = KilledMachine(tmp_path, build, **dict(RESTART, max_recoveries=100))
    told = [killed.run() for _ in range(5)]
    assert told[:4] == [None] * 4 and told[4]['outcome'] == 'aborted'
    assert killed.diary.count('begins')['DIES'] == 4


def test_a_store_of_an_earlier_version_goes_on(tmp_path):
    """It has neither the number nor the userdata of the start."""
    killed_in_b(tmp_path / 'killed', counting(10))
    killed = KilledMachine(tmp_path / 'killed', counting(20), **RESTART)
    with contextlib.closing(sqlite3.connect(killed.store)) as database:
        database.execute("DELETE FROM facts WHERE name LIKE 'start:%' OR name = 'restarts'")
        database.commit()
    assert facts_of(killed, ('start:', 'restarts')) == []
    assert killed.run()['outcome'] == 'succeeded'
    assert killed.diary.count('sees')['n=21,cups=1'] == 2
    assert tree_of(killed).whole['restarts'] == 2


@pytest.mark.parametrize('policy', ['prose', 'retry'])
def test_under_other_policies_nothing_of_it_is_stored(tmp_path, policy):
    killed = KilledMachine(tmp_path, counting(), policy=policy)
    assert killed.run()['outcome'] == 'succeeded'
    assert facts_of(killed, ('start:', 'restarts')) == []
