"""After a damaged store was accepted, what its lost moments may have told is in doubt."""

import os
import shutil
import signal
import time

import pytest
from killed_machines import in_a_process
from test_never_twice import NEVER as POUR_NEVER
from test_never_twice import ByHand, chain, killed_in, oracle_state

from smach_oracle.store import opening
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.retention import Retention
from smach_oracle.store.store_file import StoreFile

CHAIN = chain('LOOK', 'POUR', 'CARRY')
FRAME = 4096 + 24


def log_of(killed):
    return killed.store + '-wal'


def log_gone(killed):
    os.unlink(log_of(killed))


def log_and_mark_gone(killed):
    os.unlink(log_of(killed))
    os.unlink(killed.store + '-mark')


def log_of_nothing(killed):
    os.truncate(log_of(killed), 0)


def byte_wrong(part):
    def damage(killed):
        frames = os.path.getsize(log_of(killed)) // FRAME
        with open(log_of(killed), 'r+b') as log:
            log.seek(32 + FRAME * int(frames * part) + 100)
            old = log.read(1)
            log.seek(-1, os.SEEK_CUR)
            log.write(bytes([old[0] ^ 0x55]))

    return damage


def cut(part):
    def damage(killed):
        frames = os.path.getsize(log_of(killed)) // FRAME
        os.truncate(log_of(killed), 32 + FRAME * int(frames * part))

    return damage


def head_wrong(killed):
    with open(log_of(killed), 'r+b') as log:
        log.write(b'x' * 16)


DAMAGES = {
    'log gone': log_gone,
    'log and mark gone': log_and_mark_gone,
    'log empty': log_of_nothing,
    'head wrong': head_wrong,
    'cut 1/4': cut(0.25),
    'cut 1/2': cut(0.5),
    'cut 3/4': cut(0.75),
    'byte 1/8': byte_wrong(0.12),
    'byte 1/2': byte_wrong(0.5),
    'byte 7/8': byte_wrong(0.88),
}
WAYS = {
    'recover': {},
    'default': {'on_resume': 'ask'},
    'state': {'on_resume': 'state:LOOK'},
    'goto': {},
}


def accept(killed, way='recover'):
    assert 'is accepted as it is' in oracle_state(killed, 'accept')
    if way == 'goto':
        oracle_state(killed, 'goto', 'LOOK')  # where a trial is left


def never_poured_again(killed, **settings):
    before = killed.diary.count('begins')
    assert before['POUR'] == 1
    for _ in range(2):
        told = killed.run(**settings)
        assert told.get('ended_by') == 'kept', told
    assert killed.diary.count('begins') == before, 'nothing moves'
    told = killed.run(expert=ByHand(), **settings)
    assert told.get('outcome') == 'succeeded', told
    assert killed.diary.count('begins')['POUR'] == 1


def prune(killed):
    """Have all trials removed that may go."""
    store = StoreFile(killed.store)
    retention = Retention(store, days=1e-9)
    retention.plan(time.time() + 1)
    retention.drop()
    store.close()


@pytest.fixture
def killed(tmp_path):
    """A machine that was killed in CARRY, once it had poured."""
    return killed_in(tmp_path / 'killed', CHAIN, 'CARRY', **POUR_NEVER)


@pytest.mark.parametrize('way', sorted(WAYS))
@pytest.mark.parametrize('damage', sorted(DAMAGES))
def test_what_has_run_is_not_repeated_after_a_log_was_damaged(killed, damage, way):
    DAMAGES[damage](killed)
    assert 'accept' in oracle_state(killed), 'it is refused'
    accept(killed, way)
    never_poured_again(killed, **WAYS[way])


@pytest.mark.parametrize('with_log', [True, False])
def test_what_has_run_is_not_repeated_after_an_earlier_file_came_back(tmp_path, with_log):
    killed = killed_in(tmp_path / 'killed', CHAIN, 'LOOK', **POUR_NEVER)
    StoreFile(killed.store).close()  # all of it is in one file
    shutil.copy(killed.store, killed.store + '.copy')
    for _ in range(2):  # the question whether LOOK has ended, and CARRY
        killed.run(expert=ByHand(), kill_at=0 if killed.diary.count('begins')['CARRY'] else 20)
        if killed.diary.count('begins')['CARRY']:
            break
    assert killed.diary.count('begins')['POUR'] == 1
    shutil.copy(killed.store + '.copy', killed.store)
    if not with_log and os.path.exists(log_of(killed)):
        os.unlink(log_of(killed))
    assert 'accept' in oracle_state(killed), 'it is refused'
    accept(killed)
    never_poured_again(killed)


def test_a_trial_whose_beginning_is_lost_as_well_is_asked_about_once(killed):
    log_gone(killed)
    accept(killed)
    never_poured_again(killed)
    assert killed.run()['outcome'] == 'succeeded', 'a new trial is no longer in doubt'
    assert killed.diary.count('begins')['POUR'] == 2


def test_a_trial_behind_one_that_had_ended_is_asked_about(killed):
    assert killed.run(expert=ByHand())['outcome'] == 'succeeded'
    StoreFile(killed.store).close()
    shutil.copy(killed.store, killed.store + '.copy')
    point = 8
    while killed.diary.count('begins')['POUR'] < 2:  # the next trials, each killed after LOOK
        assert killed.run(kill_at=point) is None
        point += 1
    shutil.copy(killed.store + '.copy', killed.store)
    accept(killed)
    begun = killed.diary.count('begins')
    assert killed.run()['ended_by'] == 'kept'
    assert killed.diary.count('begins') == begun


@pytest.mark.parametrize('damage', ['log gone', 'cut 3/4'])  # its trial is lost, and is left
@pytest.mark.parametrize('between', [lambda _: None, prune])
def test_a_machine_that_was_asked_is_not_asked_again(killed, damage, between):
    DAMAGES[damage](killed)
    accept(killed)
    assert killed.run(expert=ByHand())['outcome'] == 'succeeded'
    for _ in range(2):
        between(killed)
        told = killed.run()
        assert told['outcome'] == 'succeeded', told


def test_a_log_that_cannot_be_set_aside_is_one_line(killed):
    head_wrong(killed)
    os.mkdir(log_of(killed) + '.damaged')
    told = oracle_state(killed, 'accept')
    assert '{0}: its log cannot be kept as {0}-wal.damaged'.format(killed.store) in told
    assert len(told.splitlines()) == 1
    os.rmdir(log_of(killed) + '.damaged')
    accept(killed)
    never_poured_again(killed)


@pytest.mark.parametrize('command', ['list', 'accept', 'drop'])
def test_a_log_that_cannot_be_read_is_one_line(killed, command):
    os.unlink(log_of(killed))
    os.mkdir(log_of(killed))
    told = oracle_state(killed, command)
    assert told.startswith('oracle_state: {}: '.format(killed.store)), told
    assert len(told.splitlines()) == 1


def test_each_accept_puts_the_machine_in_doubt_again(killed):
    DAMAGES['cut 3/4'](killed)
    accept(killed)
    assert killed.run(expert=ByHand())['outcome'] == 'succeeded'
    shutil.copy(killed.store, killed.store + '.copy')
    assert killed.run()['outcome'] == 'succeeded'
    shutil.copy(killed.store + '.copy', killed.store)
    assert 'accept' in oracle_state(killed), 'it is refused'
    accept(killed)
    assert killed.run()['ended_by'] == 'kept'


def test_a_machine_that_is_new_to_the_store_is_asked_until_one_has_answered(killed):
    log_gone(killed)
    accept(killed)
    killed.name = 'NEW'
    assert killed.run()['ended_by'] == 'kept', 'its trial may be lost'
    assert killed.run(expert=ByHand())['outcome'] == 'succeeded'
    assert killed.run()['outcome'] == 'succeeded'


@pytest.mark.parametrize('damage', sorted(DAMAGES))
def test_a_store_whose_accept_was_killed_is_still_refused(killed, damage, monkeypatch):
    DAMAGES[damage](killed)
    monkeypatch.setattr(opening, 'put_in_doubt', lambda *_: os.kill(os.getpid(), signal.SIGKILL))
    assert in_a_process(lambda: oracle_state(killed, 'accept')) is None
    monkeypatch.undo()
    assert 'CheckpointError' in killed.run()['error']
    accept(killed)
    never_poured_again(killed)


def test_a_sound_store_is_accepted_without_a_doubt(killed):
    accept(killed)
    assert killed.run()['outcome'] == 'succeeded'
    assert killed.diary.count('begins') == {'LOOK': 1, 'POUR': 1, 'CARRY': 2}


def test_a_machine_that_runs_is_not_accepted_behind_its_back(killed):
    lock = MachineLock(killed.store, 'TOP')
    log_gone(killed)
    lock.take()
    assert 'is held by process {}'.format(os.getpid()) in oracle_state(killed, 'accept')
    lock.release()
    accept(killed)
