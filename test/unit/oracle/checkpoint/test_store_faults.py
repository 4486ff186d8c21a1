"""A machine whose store cannot be written goes on, says so, and stores all once it can."""

import os
import resource
import shutil
import signal
import subprocess
import sys
import time

import pytest
from killed_machines import Diary, KilledMachine, Noted, in_a_process
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.checkpoint.trial_store import understood
from smach_oracle.oracle.errors import CheckpointError
from smach_oracle.store.errors import StoreDamaged, StoreError
from smach_oracle.store.store_file import StoreFile

HERE = os.path.dirname(os.path.abspath(__file__))
SUPPORT = os.path.join(HERE, os.pardir, os.pardir, 'support')
ENDS = {'succeeded': 'succeeded', 'aborted': 'aborted'}
LARGE = 'x' * 30000


def unshared():
    """Whether a mount of our own is allowed here."""
    found = shutil.which('unshare')
    return bool(found) and subprocess.call([found, '-rm', 'true'], stderr=subprocess.DEVNULL) == 0


class Calls(smach.State):
    def __init__(self, call, told):
        smach.State.__init__(self, ['succeeded', 'aborted'], ['done'], ['done', 'large'])
        self._call, self._told = call, told

    def execute(self, userdata):
        userdata.done = list(userdata.done) + [self._told]
        userdata.large = self._told + LARGE
        self._call()
        return 'succeeded'


def machine_of(calls):
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    names = [chr(ord('A') + number) for number in range(len(calls))]
    with machine:
        for name, following, call in zip(names, names[1:] + ['succeeded'], calls):
            smach.StateMachine.add(name, Calls(call, name), {'succeeded': following})
    return machine


def nothing():
    pass


def warned_of(log):
    smach.set_loggers(*[lambda text: None, log.append] * 2)


def wrapped(machine, store, **settings):
    return OracleContainer.wrap(
        machine,
        name='TOP',
        settings=dict({'checkpoint': store, 'on_resume': 'recover'}, **settings),
    )


def test_a_store_that_may_not_grow_is_caught_up_with(tmp_path):
    """By ulimit -f: SQLite's write fails as on a full disk."""
    store = str(tmp_path / 'robot.db')
    log = []

    def fill():
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, resource.RLIM_INFINITY))

    def free():
        assert len([text for text in log if 'The machine goes on' in text]) == 1, log
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
        assert wait_for(lambda: any('all is stored again' in text for text in log)), log

    def die():
        os.kill(os.getpid(), signal.SIGKILL)

    def work():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        warned_of(log)
        return wrapped(machine_of([nothing, fill, nothing, free, die]), store).execute()

    assert in_a_process(work) is None
    resumed = wrapped(machine_of([nothing] * 5), store)
    assert resumed.execute() == 'succeeded'
    assert resumed.userdata.done == ['A', 'B', 'C', 'D', 'E']


@pytest.mark.skipif(not unshared(), reason='no mount of its own is allowed here')
@pytest.mark.parametrize('fault', ['full', 'read_only'])
def test_on_a_disk_of_its_own(tmp_path, fault):
    """A tmpfs of 400 kB: filled up and freed again; mounted read-only."""
    shell = 'mount -t tmpfs -o size=400k none {0} && cd {0} && {1} {2}/disk_program.py {3}'.format(
        tmp_path, sys.executable, SUPPORT, fault
    )
    path = os.pathsep.join([SUPPORT, os.path.join(HERE, '../../../rostest')] + sys.path)
    told = subprocess.run(
        ['unshare', '-rm', 'sh', '-c', shell],
        env=dict(os.environ, PYTHONPATH=path),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=120,
    ).stdout.decode()
    assert told.strip().splitlines()[-1:] == ['AS IT SHOULD BE'], told


def test_one_that_turns_read_only_is_said_once_and_the_machine_goes_on(tmp_path, monkeypatch, log):
    opened = []
    monkeypatch.setattr(
        'smach_oracle.oracle.checkpoint.trial_store.StoreFile',
        lambda *given: opened.append(StoreFile(*given)) or opened[-1],
    )

    def shut():
        opened[0]._db.execute('PRAGMA query_only = ON')

    machine = wrapped(machine_of([nothing, shut, nothing, nothing]), str(tmp_path / 'robot.db'))
    assert machine.execute() == 'succeeded'
    said = [text for level, text in log if level == 'warn' and 'robot.db' in text]
    assert len(said) == 2
    assert 'readonly database. The machine goes on' in said[0]
    assert 'the end of the trial is not stored: attempt to write a readonly database' in said[1]


def test_a_slow_disk_is_waited_for_and_holds_all(tmp_path, monkeypatch, log):
    add = StoreFile.add

    def slowly(self, *given):
        time.sleep(0.03)  # that is the disk that is tried
        add(self, *given)

    monkeypatch.setattr(StoreFile, 'add', slowly)
    store = str(tmp_path / 'robot.db')
    assert wrapped(machine_of([nothing] * 4), store, checkpoint_wait_s=60).execute() == 'succeeded'
    assert not [text for level, text in log if level == 'warn']
    slow = str(tmp_path / 'slow.db')
    machine = wrapped(machine_of([nothing] * 4), slow, checkpoint_wait_s=0.001)
    assert machine.execute() == 'succeeded'
    assert 'took more than 0.001 s' in [text for level, text in log if level == 'warn'][0]
    (trial,) = StoreFile(slow).trials()
    assert trial.outcome == 'succeeded'
    kinds = [
        [(each.kind, each.label) for each in StoreFile(path).moments(1)] for path in (store, slow)
    ]
    assert kinds[0] == kinds[1]


def test_one_that_cannot_be_made_is_refused_before_anything_runs(tmp_path):
    (tmp_path / 'folder').mkdir()
    ran = []
    with pytest.raises(CheckpointError, match='folder'):
        wrapped(machine_of([lambda: ran.append(1)]), str(tmp_path / 'folder')).execute()
    assert ran == []


@pytest.mark.parametrize('jump_s', [-1e6, 1e6])
def test_a_clock_that_jumps_changes_nothing(tmp_path, monkeypatch, jump_s):
    def build(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            smach.StateMachine.add('A', Noted('A', diary, points), {'succeeded': 'B'})
            smach.StateMachine.add('B', Noted('B', diary, points), ENDS)
        return machine

    real, calls = time.time, []

    def jumping():
        calls.append(0)
        return real() + jump_s * (len(calls) % 3)

    monkeypatch.setattr('time.time', jumping)
    for point in range(3, 11):
        folder = tmp_path / str(point)
        folder.mkdir()
        killed = KilledMachine(folder, build)
        assert killed.run(kill_at=point) is None
        calls.append(0)  # the next program reads another time
        told = killed.run()
        assert told['outcome'] == 'succeeded', told
        assert told['events'][0][0] == 'RESUMED'
        assert told['done'] == ['A', 'B']
        assert Diary(str(folder / 'diary')).count('begins')['A'] <= 1 + (point < 8)
        (trial,) = StoreFile(killed.store).trials()
        assert trial.outcome == 'succeeded'


def test_one_stopped_by_ctrl_c_goes_on(tmp_path):
    def stop():
        raise KeyboardInterrupt

    store = str(tmp_path / 'robot.db')
    with pytest.raises(KeyboardInterrupt):
        wrapped(machine_of([nothing, stop, nothing]), store).execute()
    ran = []
    resumed = wrapped(
        machine_of([lambda: ran.append('A'), lambda: ran.append('B'), nothing]), store
    )
    assert resumed.execute() == 'succeeded'
    assert ran == ['B']


@pytest.mark.parametrize(
    ('raised', 'told', 'says'),
    [
        (CheckpointError('the trial is gone'), CheckpointError, '^the trial is gone$'),
        (StoreError('robot.db: is locked'), StoreError, '^robot.db: is locked$'),
        (StoreError('is locked'), StoreDamaged, '^robot.db: is locked$'),
        (KeyError('at'), StoreDamaged, r"robot.db: is damaged.*KeyError\('at'\).*`oracle_state"),
        (TypeError('no text'), StoreDamaged, 'robot.db: is damaged'),
    ],
)
def test_what_cannot_be_understood_of_a_store_names_it(raised, told, says):
    with pytest.raises(told, match=says) as caught, understood('robot.db'):
        raise raised
    assert type(caught.value) is told
