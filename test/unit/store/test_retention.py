"""Trials of a store over a limit go, and never one that has not ended or whose machine is held."""

import os
import time

import pytest

from smach_oracle.ros.disk.disk_command import main
from smach_oracle.store.accepting import put_in_doubt
from smach_oracle.store.codecs import Codecs
from smach_oracle.store.errors import StoreError
from smach_oracle.store.holding import Held, MachineLock
from smach_oracle.store.names import RENAMED, STRUCTURE
from smach_oracle.store.retention import Retention
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile

DAY_S = 86400.0
NOW = 100 * DAY_S


def add(store, name, ended_days_ago=None, values=(), machine='TASK', structure='id'):
    """A trial; None: it has not ended. Returns its number."""
    number = store.begin_trial(NewTrial(machine, name, (structure, '{}'), NOW - 90 * DAY_S))
    facts = tuple(
        Fact('TASK', 'key:{}'.format(key), Codecs().encode(value))
        for key, value in enumerate(values)
    )
    store.add(number, [NewMoment(NOW, 0, 'STATE_START', 'TASK', 'A', facts)])
    if ended_days_ago is not None:
        store.end_trial(number, NOW - ended_days_ago * DAY_S, 'succeeded')
    return number


@pytest.fixture
def store(tmp_path):
    made = StoreFile(str(tmp_path / 'robot.db'), 'OFF')
    yield made
    made.close()


def size_on_disk(store):
    return sum(
        os.path.getsize(store.path + end)
        for end in ('', '-wal')
        if os.path.exists(store.path + end)
    )


def names(store):
    return [trial.trial_id for trial in store.trials()]


def dropped(store, **limits):
    retention = Retention(store, **limits)
    retention.plan(NOW)
    retention.drop()
    return retention


def test_what_ended_long_ago_goes_with_all_that_only_it_had(store):
    image, shared = b'i' * 1000000, b's' * 5000
    add(store, 'old', 40, [image, [shared], 'x' * 300], structure='before')
    new = add(store, 'new', 1, [[shared, {'deep': [b'd' * 5000] * 9}], 'y' * 300])
    before = size_on_disk(store)
    retention = dropped(store, days=30)
    assert [each.trial.trial_id for each in retention.going] == ['old'] and names(store) == ['new']
    assert size_on_disk(store) < before - 900000, 'the file is compacted'
    values = [Codecs().decode(*fact.value, store.part) for fact in store.facts(new)]
    assert values == [[shared, {'deep': [b'd' * 5000] * 9}], 'y' * 300]
    assert store.description('before') == '' and store.description('id') == '{}'
    (parts,) = next(store._db.execute('SELECT count(*) FROM parts'))
    assert parts == 4, 'two values as text, and the bytes in one of them'


def test_the_oldest_go_until_the_store_is_small_enough(store):
    for number, days in enumerate((3, 9, 5)):
        add(store, 'trial-{}'.format(days), days, [bytes([number]) * 1000000])
    dropped(store, size=2.5e6)
    assert names(store) == ['trial-3', 'trial-5']


def test_the_facts_are_looked_through_once_however_many_trials_go(store):
    for number in range(40):
        add(store, 'trial-{}'.format(number), 90 - number, [bytes([number]) * 20000, 'y' * 300])
    done = []
    store._db.set_trace_callback(done.append)
    retention = Retention(store, size=400000)
    retention.plan(NOW)
    store._db.set_trace_callback(None)
    assert 15 < len(retention.going) < 35
    assert sum('LIKE' in each for each in done) == 1


def test_parts_that_an_earlier_program_has_left_go_as_well(store):
    add(store, 'old', 40, [b'i' * 5000])
    store._db.execute('INSERT INTO parts VALUES (?, ?)', (b'left', b'x' * 5000))
    dropped(store, days=30)
    assert store._db.execute('SELECT count(*) FROM parts').fetchone() == (0,)


def test_the_structure_that_a_trial_went_on_with_stays(store):
    add(store, 'old', 40, structure='before')
    trial = add(store, 'stopped', structure='first')
    for structure, before in (('second', 'first'), ('third', 'second')):
        store.keep_structure((structure, '{"": {}}'))
        store.add(
            trial,
            [
                NewMoment(
                    NOW,
                    0,
                    'RESUMED',
                    'TASK',
                    '',
                    tuple(
                        Fact('', name, Codecs().encode(value))
                        for name, value in ((STRUCTURE, structure), (RENAMED, [before, {}]))
                    ),
                )
            ],
        )
    store.keep_structure(('next', '{"": {}}'))  # of a program that begins just now
    dropped(store, days=30)
    assert names(store) == ['stopped'] and store.description('before') == ''
    for structure in ('second', 'third', 'next'):
        assert store.description(structure) == '{"": {}}', structure


def test_planning_changes_nothing(store):
    add(store, 'old', 40, [b'i' * 100000])
    retention = Retention(store, days=30, size=10)
    retention.plan(NOW)
    assert len(retention.going) == 1 and names(store) == ['old']
    (fact,) = store.facts(1)
    assert Codecs().decode(*fact.value, store.part) == b'i' * 100000


def test_never_one_that_has_not_ended(store):
    add(store, 'stopped')
    retention = dropped(store, days=30, size=10)
    assert names(store) == ['stopped'] and retention.kept[0].why == 'it has not ended'


def test_never_the_latest_one_of_a_machine_since_the_store_was_accepted(store):
    add(store, 'before', 60)
    put_in_doubt(store._db, 'somebody')
    for machine in ('TASK', 'OTHER'):
        for days in (50, 40):
            add(store, '{} {}'.format(machine, days), days, machine=machine)
    retention = dropped(store, days=30)
    assert names(store) == ['TASK 40', 'OTHER 40']
    assert {each.why for each in retention.kept} == {
        'it tells that a person was asked after `oracle_state accept`'
    }
    add(store, 'new', 1)
    dropped(store, days=30)
    assert names(store) == ['OTHER 40', 'new']


def test_never_one_of_a_machine_that_a_program_holds(store):
    add(store, 'old', 40)
    add(store, 'of another', 40, machine='OTHER')
    lock = MachineLock(store.path, 'TASK')
    lock.take()
    retention = dropped(store, days=30)
    assert names(store) == ['old']
    assert retention.kept[0].why == 'a program holds machine TASK'
    lock.release()
    dropped(store, days=30)
    assert names(store) == []


def test_a_machine_that_is_held_after_the_plan_loses_nothing(store):
    add(store, 'old', 40)
    retention = Retention(store, days=30)
    retention.plan(NOW)
    lock = MachineLock(store.path, 'TASK')
    lock.take()
    with pytest.raises(Held):
        retention.drop()
    assert names(store) == ['old']
    lock.release()


def test_the_command_reports_before_it_deletes(store, capsys):
    number = add(store, 'old')
    store.end_trial(number, time.time() - 40 * DAY_S, 'succeeded')
    arguments = [store.path, '--keep-days', '30']
    assert main(arguments) == 0
    assert 'would go {}: trial 1 of TASK'.format(store.path) in capsys.readouterr().out
    assert names(store) == ['old']
    assert main(arguments + ['--delete']) == 0
    assert 'removes {}: trial 1 of TASK'.format(store.path) in capsys.readouterr().out
    assert names(store) == []


def test_a_store_from_which_nothing_goes_is_told_of(store, capsys):
    add(store, 'stopped')
    add(store, 'new', 1)
    for more in ([], ['--delete']):
        assert main([store.path, '--keep-days', '{:.0f}'.format(time.time() / DAY_S), *more]) == 0
        assert (
            '{}: 0 trials would go; 0 over the limits stay\n'.format(store.path)
            in capsys.readouterr().out
        )


def test_a_store_that_is_none_or_damaged_is_told_and_left(tmp_path, capsys):
    path = tmp_path / 'robot.db'
    assert main([str(path), '--keep-days', '1', '--delete']) == 2 and not path.exists()
    path.write_bytes(b'no store' * 1000)
    assert main([str(path), '--keep-days', '1', '--delete']) == 2
    assert path.read_bytes() == b'no store' * 1000
    assert capsys.readouterr().err.count('robot.db') == 2


def test_a_store_that_another_program_writes_is_told(store):
    add(store, 'old', 40)
    other = StoreFile(store.path, 'OFF')
    other._db.execute('BEGIN IMMEDIATE')
    store._db.execute('PRAGMA busy_timeout = 10')
    with pytest.raises(StoreError, match='locked'):
        Retention(store, days=30).plan(NOW)
    other._db.execute('ROLLBACK')
    other.close()
