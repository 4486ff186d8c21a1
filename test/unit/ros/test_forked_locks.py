"""A child that is forked while its parent holds the lock of a file does not keep that lock."""

import fcntl
import os
import re
import signal
from pathlib import Path
from types import SimpleNamespace

import pytest

import smach_oracle
from smach_oracle.experiment.cluster_launch import RUNNING_FILE, ClusterLaunch
from smach_oracle.experiment.pool import alone_in
from smach_oracle.expert.console.people.shift_journal import ShiftJournal
from smach_oracle.expert.console.trials.bag_catalogue import BagCatalogue
from smach_oracle.oracle.records.folder_locks import folder_lock
from smach_oracle.ros.disk import bag_folder
from smach_oracle.ros.recording.bag_repair import recover_folder
from smach_oracle.ros.recording.bag_writer import BagWriter
from smach_oracle.store.holding import MachineLock, check_nobody_holds

PACKAGE = Path(smach_oracle.__file__).parent
SAYS_NOTHING = str  # as a log


def bag_repair(path):
    active = path.with_name('20150401T101112.345Z_t.bag.active')
    BagWriter(str(active)).abandon()
    os.link(str(active), str(path))  # its name changes
    recover_folder(str(path.parent), SAYS_NOTHING, SAYS_NOTHING)
    return path


def bag_writer(path):
    BagWriter(str(path)).abandon()
    return path


def disk(path):
    path.touch()
    assert not bag_folder._why_locked(str(path))
    return path


def catalogue(path):
    path.touch()
    folders = SimpleNamespace(open=lambda name: os.open(name, os.O_RDONLY))
    assert not BagCatalogue._is_written(
        SimpleNamespace(_folders=folders), str(path), SimpleNamespace(changed_ns=0)
    )
    return path


def shift_journal(path):
    ShiftJournal(str(path)).write_note('ann', 'the arm is stowed')
    return path


def rates_folder(path):
    with folder_lock(str(path.parent)):
        pass
    return path.parent


def lock_of(path):
    return next(path.parent.glob(path.name + '-lock-*'))


def held_machine(path):
    lock = MachineLock(str(path), 'TASK')
    lock.take()
    lock.release()
    return lock_of(path)


def looked_at_machine(path):
    lock = MachineLock(str(path), 'TASK')
    Path(lock._file).touch()
    assert not lock.is_held_elsewhere()
    return lock_of(path)


def looked_at_all_machines(path):
    Path(MachineLock(str(path), 'TASK')._file).touch()
    check_nobody_holds(str(path), str(path))
    return lock_of(path)


def experiment(path):
    with alone_in(path):
        pass
    return path / '.lock'


def cluster(path):
    file = path.parent / RUNNING_FILE
    file.write_text('token')
    assert ClusterLaunch._helper_gone(SimpleNamespace(_folder=path.parent, _token='token'))
    return file


WAYS = {
    'ros/recording/bag_repair.py': [bag_repair],
    'ros/recording/bag_writer.py': [bag_writer],
    'ros/disk/bag_folder.py': [disk],
    'expert/console/trials/bag_catalogue.py': [catalogue],
    'expert/console/people/shift_journal.py': [shift_journal],
    'oracle/records/folder_locks.py': [rates_folder],
    'experiment/pool.py': [experiment],
    'experiment/cluster_launch.py': [cluster],
    'store/holding.py': [held_machine, looked_at_machine, looked_at_all_machines],
}


@pytest.fixture
def forks_as_it_locks(monkeypatch):
    """Fork a child that lives on behind each lock, as another thread may; it runs no hook of ours.

    So is a child that a library forks, and one that is forked before a decision was made for it.
    """
    children, flock = [], fcntl.flock

    def locks(file, kind):
        flock(file, kind)
        if kind & (fcntl.LOCK_EX | fcntl.LOCK_SH):
            with monkeypatch.context() as patch:
                patch.setattr('smach_oracle.forking._of_objects', {})
                child = os.fork()
            if not child:
                signal.pause()
            children.append(child)

    monkeypatch.setattr(fcntl, 'flock', locks)
    yield children
    for child in children:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def can_lock(path):
    descriptor = os.open(str(path), os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True


@pytest.mark.parametrize('way', [way for ways in WAYS.values() for way in ways])
def test_a_child_that_is_forked_meanwhile_does_not_keep_the_lock(tmp_path, forks_as_it_locks, way):
    path = way(tmp_path / 'file')
    assert forks_as_it_locks, 'it has locked'
    assert can_lock(path)


def test_each_module_that_locks_a_file_is_tried():
    found = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob('*.py')
        if re.search(r'fcntl\.(flock|lockf)\(.*(LOCK_[ES]|kind)', path.read_text())
    }
    assert found == set(WAYS)
