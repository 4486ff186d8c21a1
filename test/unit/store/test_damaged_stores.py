"""A store that has lost some of it goes on where it stood, or is refused with what to do."""

import os
import random
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys

import pytest

from smach_oracle.store.codecs import Codecs
from smach_oracle.store.errors import StoreError
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.state_command import main as oracle_state
from smach_oracle.store.store_file import NewTrial, StoreFile

MOMENTS = 30
FILES = ('', '-wal', '-mark')


def moment(seq):
    return NewMoment(
        float(seq),
        seq,
        'STATE_START',
        'TASK',
        'A',
        (Fact('TASK', 'key:a', Codecs().encode([seq, 'x' * 300])),),
    )


def write(path, name, synchronous, moments):
    store = StoreFile(path, synchronous)
    trial = store.begin_trial(NewTrial('TASK', name, ('id', '{}'), 5.0))
    for seq in range(moments):
        store.add(trial, [moment(seq)])
    return store  # freed, it would be closed


def killed(path, name='abc', synchronous='FULL', moments=MOMENTS):
    """A store whose program was killed."""
    child = os.fork()
    if not child:
        _store = write(path, name, synchronous, moments)
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    return path


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """The files of a store that was killed, and of another one."""
    folder = tmp_path_factory.mktemp('whole')
    return killed(str(folder / 'robot.db')), killed(str(folder / 'other.db'), 'def', moments=45)


@pytest.fixture
def path(whole, tmp_path):
    there = str(tmp_path / 'robot.db')
    for end in FILES:
        shutil.copy(whole[0] + end, there + end)
    return there


def bytes_of(path):
    with open(path, 'rb') as stream:
        return stream.read()


def flip(path, place):
    with open(path, 'r+b') as stream:
        stream.seek(place)
        old = stream.read(1)
        stream.seek(place)
        stream.write(bytes([old[0] ^ 0x55]))


def seen(path):
    """What a program finds: the number of moments, or the error."""
    found = []
    for read_only in (True, False):
        try:
            store = StoreFile(path, read_only=read_only)
        except StoreError as err:
            found.append(str(err))
            continue
        try:
            (trial,) = store.trials()
            values = {
                fact.name: Codecs().decode(*fact.value, store.part)[0]
                for fact in store.facts(trial.number)
                if fact.name
            }
            assert trial.trial_id == 'abc'
            found.append((trial.moments, values['key:a']))
        except StoreError as err:
            found.append(str(err))
        finally:
            store.close()
    return found


def test_one_whose_program_was_killed_goes_on_and_again(path):
    for _ in range(2):
        assert seen(path) == [(MOMENTS, MOMENTS - 1)] * 2


def test_its_tables_are_in_its_own_file_before_its_log_begins(tmp_path):
    there = str(tmp_path / 'robot.db')
    store = StoreFile(there)
    copy = str(tmp_path / 'copy.db')
    shutil.copy(there, copy)
    store.close()
    with sqlite3.connect(copy) as database:
        assert database.execute('PRAGMA application_id').fetchone() == (0x534D4F53,)
        assert database.execute('SELECT count(*) FROM moments').fetchone() == (0,)


def test_one_that_is_closed_is_one_file_and_its_mark(tmp_path):
    there = str(tmp_path / 'robot.db')
    write(there, 'abc', 'FULL', 2)
    store = StoreFile(there)
    store.close()
    assert sorted(os.listdir(str(tmp_path)))[:2] == ['robot.db', 'robot.db-mark']


def refused(path, *words):
    moved = [seen(path), seen(path)]
    assert moved[0] == moved[1], 'it stays as it is'
    for each in moved[0]:
        assert isinstance(each, str), each
        assert path in each and all(word in each for word in words), each


@pytest.mark.parametrize('without', [('-wal',), ('-wal', '-mark')])
def test_a_log_that_is_lost_is_found_out(path, without):
    for end in without:
        os.unlink(path + end)
    refused(path, '-wal, is missing', 'oracle_state', 'accept')


@pytest.mark.parametrize('size', [0, 20])
@pytest.mark.parametrize('without', [(), ('-mark',)])
def test_a_log_that_is_empty_is_found_out(path, size, without):
    os.truncate(path + '-wal', size)
    for end in without:
        os.unlink(path + end)
    refused(path, 'accept')


@pytest.mark.parametrize('left', [('-wal', '-mark'), ('-wal',), ('-mark',)])
@pytest.mark.parametrize('is_empty', [True, False])
def test_a_store_that_is_gone_or_empty_is_no_new_one(path, left, is_empty):
    for end in FILES[1:]:
        if end not in left:
            os.unlink(path + end)
    os.truncate(path, 0)
    if not is_empty:
        os.unlink(path)
    refused(path, 'remove', left[0])


def test_an_empty_file_is_no_new_store(tmp_path):
    there = str(tmp_path / 'robot.db')
    open(there, 'w').close()
    refused(there, 'is empty', 'remove')


@pytest.mark.parametrize('size', [1, 50, 100, 1000, 4000])
@pytest.mark.parametrize('without', [(), ('-mark',), ('-wal',), ('-wal', '-mark')])
def test_a_file_that_is_cut_off_is_no_new_store(path, size, without):
    """With its log SQLite can make it whole again, so that it may also go on."""
    os.truncate(path, size)
    for end in without:
        os.unlink(path + end)
    for each in seen(path):
        assert isinstance(each, str) or ('-wal' not in without and each == (MOMENTS, MOMENTS - 1))


def test_the_log_of_another_store_is_found_out(path, whole):
    shutil.copy(whole[1] + '-wal', path + '-wal')
    refused(path, 'is not its own', 'accept')


def test_a_store_in_place_of_another_is_found_out(path, whole):
    older = str(os.path.dirname(path)) + '/older.db'
    write(older, 'abc', 'FULL', 3)
    StoreFile(older).close()
    os.unlink(path + '-wal')
    shutil.copy(older, path)
    refused(path, 'accept')


@pytest.mark.parametrize('seed', range(60))
def test_a_byte_that_is_wrong_in_the_log_loses_nothing_in_silence(path, seed):
    chance = random.Random(seed)
    size = os.path.getsize(path + '-wal')
    frame = 4096 + 24
    place = chance.choice(
        (
            chance.randrange(32),
            32 + frame * chance.randrange(size // frame) + chance.randrange(frame),
        )
    )
    flip(path + '-wal', place)
    for each in seen(path):
        assert each == (MOMENTS, MOMENTS - 1) or (isinstance(each, str) and path in each), place


@pytest.mark.parametrize('seed', range(20))
def test_a_last_write_that_was_torn_is_no_damage(tmp_path, seed):
    """As a power cut leaves it: the mark is not written before the moment is on the disk."""
    there = str(tmp_path / 'robot.db')
    killed(there, moments=5)
    mark, before = bytes_of(there + '-mark'), os.path.getsize(there + '-wal')
    child = os.fork()
    if not child:
        store = StoreFile(there)
        store.add(1, [moment(5)])
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    after = os.path.getsize(there + '-wal')
    os.truncate(there + '-wal', random.Random(seed).randrange(before, after))
    with open(there + '-mark', 'wb') as stream:
        stream.write(mark)
    assert seen(there) == [(5, 4)] * 2


def test_what_a_power_cut_may_cost_is_no_damage_where_the_setting_allows_it(tmp_path):
    for synchronous, is_lost in (('NORMAL', False), ('FULL', True)):
        there = killed(str(tmp_path / synchronous), synchronous=synchronous)
        size = os.path.getsize(there + '-wal')
        os.truncate(there + '-wal', size // 2)
        with open(there + '-mark', 'r+b') as stream:
            told = stream.read().decode()
            stream.seek(0)
            stream.write(told.replace(told.split('"boot":"')[1][:8], 'anothers').encode())
        assert all(isinstance(each, str) for each in seen(there)) == is_lost


@pytest.mark.parametrize('synchronous', ['FULL', 'NORMAL'])
@pytest.mark.parametrize('is_same_boot', [False, True])
def test_a_log_that_never_came_to_the_disk_is_no_damage_after_a_power_cut(
    tmp_path, synchronous, is_same_boot
):
    """The mark on the disk is still that of the program before, which had closed the store."""
    there = str(tmp_path / 'robot.db')
    store = StoreFile(there)
    store.add(store.begin_trial(NewTrial('TASK', 'abc', ('id', '{}'), 5.0)), [moment(0), moment(1)])
    store.close()
    mark = bytes_of(there + '-mark').decode()
    if not is_same_boot:
        mark = mark.replace(mark.split('"boot":"')[1][:8], 'anothers')
    child = os.fork()
    if not child:
        opened = StoreFile(there, synchronous)
        if synchronous == 'NORMAL':
            opened.add(1, [moment(2)])
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    if os.path.exists(there + '-wal'):
        os.unlink(there + '-wal')
    with open(there + '-mark', 'w') as stream:
        stream.write(mark)
    if is_same_boot:
        refused(there, 'accept')
    else:
        assert seen(there) == [(2, 1)] * 2


def test_what_can_be_read_is_accepted_by_hand(path, capsys):
    frame = 4096 + 24
    flip(path + '-wal', os.path.getsize(path + '-wal') - frame * 12)
    refused(path, 'latest moments are missing')
    assert oracle_state([path, 'list']) == 2
    assert oracle_state([path, 'accept']) == 0
    assert 'with 1 trial' in capsys.readouterr().out
    (read, value), written = seen(path)
    assert 0 < read < MOMENTS and written == (read, value)
    assert value == read - 2, 'the last moment says that it is in doubt'


def test_a_log_that_is_not_its_own_is_kept_under_another_name(path, whole):
    shutil.copy(whole[1] + '-wal', path + '-wal')
    assert oracle_state([path, 'accept']) == 0
    assert bytes_of(path + '-wal.damaged') == bytes_of(whole[1] + '-wal')
    StoreFile(path).close()


def test_what_is_no_file_is_named(tmp_path):
    (tmp_path / 'folder').mkdir()
    os.mkfifo(str(tmp_path / 'pipe'))
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(str(tmp_path / 'socket'))
    for name, kind in (('folder', 'a folder'), ('pipe', 'a pipe'), ('socket', 'a socket')):
        refused(str(tmp_path / name), 'is {}, no store'.format(kind))
    listening.close()


def test_a_link_leads_to_the_store_and_its_log(path):
    link = path + '.link'
    os.symlink(path, link)
    os.unlink(path + '-wal')
    refused(link, 'is missing', 'accept')


@pytest.mark.parametrize('left', ['', 'log'])
def test_a_store_of_an_earlier_program_is_read(tmp_path, left):
    """It left its file as if a log followed, and had its tables in the log at first."""
    there = str(tmp_path / 'robot.db')
    write(there, 'abc', 'FULL', 4)
    StoreFile(there).close()
    os.unlink(there + '-mark')
    code = (
        'import os, sqlite3, sys\n'
        'database = sqlite3.connect(sys.argv[1], isolation_level=None)\n'
        'database.execute("PRAGMA journal_mode = WAL")\n'
        'database.execute("DROP TABLE marked")\n'
        'database.execute("UPDATE trials SET begun = 6.0")\n'
        'os.kill(os.getpid(), 9) if sys.argv[2] else database.close()\n'
    )
    subprocess.run([sys.executable, '-c', code, there, left], check=False)
    assert seen(there) == [(4, 3)] * 2
    assert seen(there) == [(4, 3)] * 2


PRUNES = (
    'import os, sys\n'
    'from smach_oracle.store.retention import Retention\n'
    'from smach_oracle.store.store_file import StoreFile\n'
    'store = StoreFile(sys.argv[1])\n'
    'StoreFile.compact = StoreFile.compact if sys.argv[2] == "whole" else '
    'lambda store: os.kill(os.getpid(), 9)\n'
    'retention = Retention(store, days=1.0)\n'
    'retention.plan(1e9)\n'
    'assert len(retention.going) == 3\n'
    'retention.drop()\n'
    'store.close()\n'
)


def ended(store, name, machine='TASK'):
    trial = store.begin_trial(NewTrial(machine, name, ('id', '{}'), 5.0))
    store.add(trial, [moment(0), moment(1)])
    store.end_trial(trial, 6.0, 'succeeded')


def prune(path, way):
    code = [sys.executable, '-c', PRUNES, path, way]
    assert subprocess.run(
        code, env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)), check=False
    ).returncode == (0 if way == 'whole' else -signal.SIGKILL)


@pytest.mark.parametrize('way', ['whole', 'killed'])
def test_trials_that_are_removed_are_not_missed(tmp_path, way):
    there = str(tmp_path / 'robot.db')
    store = StoreFile(there)
    for name in 'abc':
        ended(store, name)
    store.close()
    prune(there, way)
    again = StoreFile(there)
    assert again.trials() == []
    again.close()


@pytest.mark.parametrize('then', ['', 'add', 'end', 'begin'])
@pytest.mark.parametrize('is_killed', [True, False])
def test_trials_that_another_program_removes_meanwhile_are_not_missed(tmp_path, then, is_killed):
    """Also where the last moments and trials were among them."""
    there = str(tmp_path / 'robot.db')
    first = StoreFile(there)
    ended(first, 'first')
    first.close()
    child = os.fork()
    if not child:
        store = StoreFile(there)
        trial = store.begin_trial(NewTrial('OTHER', 'runs', ('id', '{}'), 5.0))
        store.add(trial, [moment(0)])
        second = StoreFile(there)
        ended(second, 'second')
        ended(second, 'third')
        prune(there, 'whole')
        if then == 'add':
            store.add(trial, [moment(1)])
        elif then == 'end':
            store.end_trial(trial, 1e9, 'succeeded')
        elif then == 'begin':
            store.begin_trial(NewTrial('OTHER', 'next', ('id', '{}'), 5.0))
        second.close()
        if not is_killed:
            store.close()
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    again = StoreFile(there)
    assert [each.trial_id for each in again.trials()][:1] == ['runs']
    again.close()


def test_a_program_that_opens_its_store_twice_keeps_its_log_from_other_programs(tmp_path):
    """Such as one with two machines. Where it closes a file, it loses its locks on that."""
    there = str(tmp_path / 'robot.db')
    code = 'import sys\nfrom smach_oracle.store.store_file import StoreFile\n'
    other = [sys.executable, '-c', code + 'StoreFile(sys.argv[1]).close()', there]
    child = os.fork()
    if not child:
        try:
            first, second = StoreFile(there), StoreFile(there)
            trial = first.begin_trial(NewTrial('TASK', 'runs', ('id', '{}'), 5.0))
            subprocess.run(other, check=True)
            first.add(trial, [moment(0)])
            second.close()
            subprocess.run(other, check=True)
            first.add(trial, [moment(1)])
            os.kill(os.getpid(), signal.SIGKILL)
        finally:
            os._exit(1)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    again = StoreFile(there)
    (trial,) = again.trials()
    assert len(again.moments(trial.number)) == 2
    again.close()


def test_programs_that_open_and_close_one_store_at_once_find_no_damage(tmp_path):
    there = str(tmp_path / 'robot.db')
    code = (
        'import sys\nfrom smach_oracle.store.store_file import NewTrial, StoreFile\n'
        'for number in range(15):\n'
        '    store = StoreFile(sys.argv[1], "OFF")\n'
        '    trial = store.begin_trial(NewTrial("T", sys.argv[2] + str(number), '
        '("i", ""), 0))\n'
        '    store.end_trial(trial, 1.0, "ok")\n'
        '    StoreFile(sys.argv[1], read_only=True).trials()\n'
        '    store.close()\n'
    )
    programs = [
        subprocess.Popen(
            [sys.executable, '-c', code, there, name],
            env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)),
        )
        for name in 'abc'
    ]
    assert [each.wait(120) for each in programs] == [0, 0, 0]
    store = StoreFile(there)
    assert len(store.trials()) == 45
    store.close()
