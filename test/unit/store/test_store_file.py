"""The database of a store."""

import os
import sqlite3
import subprocess
import sys
import time

import pytest

from smach_oracle.store.codecs import Codecs
from smach_oracle.store.errors import StoreDamaged, StoreError
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile

TRIAL = NewTrial('TASK', 'abc', ('id', 'description'), 5.0)


def moment(seq, *facts):
    codecs = Codecs()
    return NewMoment(
        float(seq),
        seq,
        'STATE_START',
        'TASK',
        'A',
        tuple(
            Fact('TASK', name, None if value is None else codecs.encode(value))
            for name, value in facts
        ),
    )


def held(store, trial, until=None):
    found = {}
    for fact in store.facts(trial, until):
        found[fact.name] = Codecs().decode(*fact.value, store.part) if fact.value.is_there else None
    return found


@pytest.fixture
def path(tmp_path):
    return str(tmp_path / 'robot.db')


def test_what_was_committed_is_there_in_another_program(path):
    store = StoreFile(path)
    number = store.begin_trial(TRIAL)
    store.add(number, [moment(0, ('key:a', 1), ('key:b', 'x' * 1000)), moment(3, ('key:a', 2))])
    other = StoreFile(path, read_only=True)
    (trial,) = other.trials('TASK')
    assert (trial.trial_id, trial.moments, trial.ended) == ('abc', 2, None)
    assert held(other, number) == {'key:a': 2, 'key:b': 'x' * 1000}
    assert other.description('id') == 'description'
    assert other.trials('OTHER') == []


def test_every_moment_can_be_gone_back_to(path):
    store = StoreFile(path)
    number = store.begin_trial(TRIAL)
    store.add(number, [moment(0, ('key:a', 1)), moment(1, ('key:a', None)), moment(2)])
    first, second, third = store.moments(number)
    assert held(store, number, first.number) == {'key:a': 1}
    assert held(store, number, second.number) == {'key:a': None}
    assert [each.seq for each in (first, second, third)] == [0, 1, 2]


def test_who_stops_reading_may_close_the_store_first(path, monkeypatch):
    printed = []
    monkeypatch.setattr(sys, 'unraisablehook', printed.append)
    store = StoreFile(path)
    number = store.begin_trial(TRIAL)
    store.add(number, [moment(0, ('key:a', 1), ('key:b', 2))])
    facts = store.facts(number)
    next(facts)
    store.close()
    del facts  # what is raised here is printed
    assert not printed


def test_large_values_are_kept_once(path):
    store = StoreFile(path)
    number = store.begin_trial(TRIAL)
    for seq in range(20):
        store.add(number, [moment(seq, ('key:image', b'i' * 100000))])
    store.close()
    assert os.path.getsize(path) < 300000


def test_moments_are_added_all_or_none(path):
    store = StoreFile(path)
    number = store.begin_trial(TRIAL)
    with pytest.raises(sqlite3.Error):
        store.add(number, [moment(0, ('key:a', 1)), moment(1)._replace(kind=None)])
    assert store.moments(number) == []
    store.add(number, [moment(0)])
    assert len(store.moments(number)) == 1


def test_a_trial_that_has_ended_says_so(path):
    store = StoreFile(path)
    number = store.begin_trial(TRIAL)
    store.end_trial(number, 9.0, 'succeeded')
    assert store.trials()[0][5:7] == (9.0, 'succeeded')


def test_the_latest_trial_of_a_machine_is_read_alone(path):
    store = StoreFile(path)
    for name, machine in (('first', 'TASK'), ('second', 'TASK'), ('third', 'OTHER')):
        store.begin_trial(TRIAL._replace(machine=machine, trial_id=name))
    assert store.latest_trial('TASK') == store.trials('TASK')[-1] == store.trials()[1]
    assert store.latest_trial('NONE') is None
    plans = []
    store._db.set_trace_callback(plans.append)
    store.latest_trial('TASK')
    store._db.set_trace_callback(None)
    (told,) = plans
    steps = [row[3] for row in store._db.execute('EXPLAIN QUERY PLAN ' + told)]
    assert 'trials_of' in steps[0] and not any('SORT' in each.upper() for each in steps), steps


def test_an_edit_is_logged(path):
    store = StoreFile(path)
    number = store.begin_trial(TRIAL)
    store.edit(number, moment(0, ('key:a', 7))._replace(kind='EDIT'), 'anna', 'a = 7')
    assert held(store, number) == {'key:a': 7}
    (line,) = store.log()
    assert (line.who, line.what) == ('anna', 'a = 7')


def test_two_programs_write_one_store(path):
    one, other = StoreFile(path), StoreFile(path)
    first = one.begin_trial(TRIAL)
    second = other.begin_trial(TRIAL._replace(machine='OTHER', trial_id='def'))
    one.add(first, [moment(0)])
    other.add(second, [moment(0)])
    assert [trial.moments for trial in one.trials()] == [1, 1]


def test_what_is_no_store_is_refused_and_left_alone(tmp_path):
    other = tmp_path / 'notes.txt'
    other.write_text('These are my notes, and they are longer than a hundred letters. ' * 10)
    with pytest.raises(StoreDamaged, match='notes.txt: is damaged, or no store'):
        StoreFile(str(other))
    assert other.read_text().startswith('These are my notes')
    database = tmp_path / 'other.db'
    with sqlite3.connect(str(database)) as connection:
        connection.execute('CREATE TABLE mine (a)')
    with pytest.raises(StoreError, match='is no store of smach_oracle'):
        StoreFile(str(database))


@pytest.mark.parametrize('where', ['no/such/folder/robot.db', '.'])
def test_a_place_where_none_can_be_is_named(tmp_path, where):
    with pytest.raises(StoreError, match=str(tmp_path)):
        StoreFile(str(tmp_path / where))


def test_a_log_that_cannot_be_read_where_nothing_can_be_written_is_named(path, monkeypatch):
    store = StoreFile(path)
    store.begin_trial(TRIAL)

    def fails(*given, **more):
        raise sqlite3.OperationalError('unable to open database file')

    monkeypatch.setattr(sqlite3, 'connect', fails)
    for may_write, why in (
        (True, ''),
        (False, '; nothing can be written there, so copy it with robot.db-wal to another folder'),
    ):
        monkeypatch.setattr(os, 'access', lambda *given, may=may_write: may)
        with pytest.raises(StoreError) as told:
            StoreFile(path, read_only=True)
        assert str(told.value) == '{}: unable to open database file{}'.format(path, why)
    store.close()
    with pytest.raises(StoreError, match='; nothing can be written there$'):
        StoreFile(path)


def test_a_reader_makes_no_store(path):
    with pytest.raises(StoreError, match='there is no such store'):
        StoreFile(path, read_only=True)
    assert not os.path.exists(path)


def test_a_later_format_is_refused(path):
    StoreFile(path).close()
    with sqlite3.connect(path) as connection:
        connection.execute('PRAGMA user_version = 99')
    with pytest.raises(StoreError, match='has format 99, and this program knows 1'):
        StoreFile(path)


def test_a_store_cut_off_anywhere_has_what_was_committed_before(path, tmp_path):
    """Of the last write any part may be missing, as after a power cut: it is there, or not."""
    store = StoreFile(path, 'FULL')
    number = store.begin_trial(TRIAL)
    store.add(number, [moment(0, ('key:a', 0))])
    log = path + '-wal'
    before = os.path.getsize(log)
    store.add(number, [moment(1, ('key:a', 1), ('key:b', 'x' * 2000))])
    whole = open(log, 'rb').read()
    database = open(path, 'rb').read()
    assert len(whole) > before
    found = set()
    for length in sorted({*range(before, len(whole), 97), before + 1, len(whole) - 1, len(whole)}):
        copy = tmp_path / 'cut.db'
        for end in ('', '-wal', '-shm'):
            if os.path.exists(str(copy) + end):
                os.remove(str(copy) + end)
        copy.write_bytes(database)
        (tmp_path / 'cut.db-wal').write_bytes(whole[:length])
        cut = StoreFile(str(copy))
        seqs = [each.seq for each in cut.moments(number)]
        values = held(cut, number)
        assert (seqs, values) in [([0], {'key:a': 0}), ([0, 1], {'key:a': 1, 'key:b': 'x' * 2000})]
        found.add(len(seqs))
        cut.add(number, [moment(2)])
        cut.close()
    assert found == {1, 2}


BEGINS_AND_ENDS = """
import sys, time, os
from smach_oracle.store.store_file import NewTrial, StoreFile
time.sleep(max(0.0, float(sys.argv[2]) - time.time()))
for number in range(12):
    for path in sys.argv[1] + str(number), sys.argv[1]:
        store = StoreFile(path, "OFF")
        trial = NewTrial("T", "{}-{}".format(os.getpid(), number), ("i", ""), 0)
        store.end_trial(store.begin_trial(trial), 1.0, "ok")
        store.close()
"""


def test_programs_that_begin_and_end_at_once_open_new_and_old_stores(tmp_path):
    """SQLite does not wait for a lock where it begins a log, and a log goes with its last user."""
    for number in range(3):
        arguments = [str(tmp_path / 'robot{}.db'.format(number)), str(time.time() + 1.0)]
        programs = [
            subprocess.Popen(
                [sys.executable, '-c', BEGINS_AND_ENDS, *arguments],
                env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)),
            )
            for _ in range(6)
        ]
        assert [each.wait(60) for each in programs] == [0] * 6
