"""A store that cannot be used: what a program that wraps its machine itself gets."""

import contextlib
import os

import pytest

import smach
from smach_oracle.oracle import CheckpointError, OracleContainer
from smach_oracle.oracle.errors import OracleError, SettingsError
from smach_oracle.store.errors import StoreError
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.store_file import StoreFile

NOBODY = 65534


class Moving(smach.State):
    def __init__(self, moved):
        smach.State.__init__(self, ['succeeded'])
        self._moved = moved

    def execute(self, userdata):
        self._moved.append(1)
        return 'succeeded'


class Interrupted(list):
    """In place of what has moved: the state is interrupted as it moves."""

    def append(self, item):
        raise KeyboardInterrupt


def wrapped(store, moved, name='TOP', **settings):
    machine = smach.StateMachine(['succeeded'])
    with machine:
        smach.StateMachine.add('MOVE', Moving(moved), {'succeeded': 'succeeded'})
    return OracleContainer.wrap(machine, name=name, settings=dict(settings, checkpoint=str(store)))


def no_folder(path):
    return path / 'none' / 'robot.db', 'cannot be locked'


def notes(path):
    (path / 'notes.txt').write_text('These are my notes, and they are long enough. ' * 20)
    return path / 'notes.txt', 'is damaged, or no store'


def cut_off(path):
    StoreFile(str(path / 'robot.db')).close()
    os.truncate(str(path / 'robot.db'), 5000)
    return path / 'robot.db', 'robot.db: '


@pytest.mark.parametrize('make', [no_folder, notes, cut_off])
def test_it_is_named_and_nothing_has_run(tmp_path, make):
    store, why = make(tmp_path)
    moved = []
    with pytest.raises(CheckpointError, match='TOP does not begin') as caught:
        wrapped(store, moved).execute()
    assert why in str(caught.value) and isinstance(caught.value, OracleError)
    assert not moved


def test_a_machine_that_is_held_can_begin_once_it_is_free(tmp_path):
    moved = []
    lock = MachineLock(str(tmp_path / 'robot.db'), 'TOP')
    lock.take()
    machine = wrapped(tmp_path / 'robot.db', moved)
    with pytest.raises(CheckpointError, match='held by process {}'.format(os.getpid())):
        machine.execute()
    assert not moved
    lock.release()
    assert machine.execute() == 'succeeded'


def test_after_a_wrong_setting_the_machine_is_let_go(tmp_path):
    store = StoreFile(str(tmp_path / 'robot.db'))
    store.close()
    with pytest.raises(SettingsError):
        wrapped(tmp_path / 'robot.db', [], resume_from=7).execute()
    assert wrapped(tmp_path / 'robot.db', []).execute() == 'succeeded'


def test_a_moment_of_another_machine_of_the_program_is_not_for_this_one(tmp_path):
    store, moved = tmp_path / 'robot.db', []
    for name in ('OTHER', 'TOP'):
        with pytest.raises(KeyboardInterrupt):
            wrapped(store, Interrupted(), name).execute()
    with contextlib.closing(StoreFile(str(store))) as opened:
        (other,), (own,) = opened.trials('OTHER'), opened.trials('TOP')
        number = opened.moments(other.number)[-1].number
        last = opened.moments(own.number)[-1].number
    machine, seen = wrapped(store, moved, resume_from=number, on_resume='recover'), []
    machine.events.observers.append(seen.append)
    assert (machine.execute(), moved) == ('succeeded', [1])
    assert seen[0].data['moment'] == last, 'not an earlier one'


def test_a_store_that_cannot_be_written_is_found_out_when_it_is_opened(tmp_path):
    path = str(tmp_path / 'robot.db')
    StoreFile(path).close()
    os.chmod(str(tmp_path), 0o777)
    os.chmod(path, 0o444)
    child = os.fork()
    if not child:
        code = 1
        try:
            if os.geteuid() == 0:
                os.chdir(str(tmp_path))
                os.setuid(NOBODY)
            StoreFile('robot.db')
        except StoreError:
            code = 0
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0


def open_files(path):
    """The names below a path that this process has open."""
    links = (os.path.join('/proc/self/fd', number) for number in os.listdir('/proc/self/fd'))
    return [name for name in map(os.path.realpath, links) if name.startswith(str(path))]


def test_a_store_is_closed_as_its_trial_ends_and_where_it_is_refused(tmp_path):
    machine = wrapped(tmp_path / 'robot.db', [])
    assert machine.execute() == 'succeeded'
    assert not open_files(tmp_path)
    with pytest.raises(SettingsError) as caught:
        wrapped(tmp_path / 'robot.db', [], resume_from=7).execute()
    assert caught.value.key == 'checkpoint.from' and not open_files(tmp_path)
