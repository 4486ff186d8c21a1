"""A machine of a store is held by one process at a time."""

import os
import signal
import threading

import pytest

from smach_oracle.store.errors import StoreError
from smach_oracle.store.holding import Held, MachineLock


@pytest.fixture
def path(tmp_path):
    return str(tmp_path / 'robot.db')


def test_a_second_holder_is_told_who_holds_it(path):
    lock, other = MachineLock(path, 'TASK'), MachineLock(path, 'TASK')
    lock.take()
    with pytest.raises(Held, match='machine TASK is held by process {}'.format(os.getpid())):
        other.take()
    assert other.is_held_elsewhere() and not lock.is_held_elsewhere()
    lock.release()
    assert not other.is_held_elsewhere()
    other.take()


def test_who_only_looks_makes_no_file_and_refuses_nobody(path):
    looks, lock = MachineLock(path, 'TASK'), MachineLock(path, 'TASK')
    assert not looks.is_held_elsewhere()
    assert not os.listdir(os.path.dirname(path))
    lock.take()
    lock.release()
    looking = threading.Event()

    def look():
        while not looking.is_set():
            looks.is_held_elsewhere()

    threads = [threading.Thread(target=look) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(50):
            lock.take()
            assert MachineLock(path, 'TASK').is_held_elsewhere()
            lock.release()
    finally:
        looking.set()
        for thread in threads:
            thread.join()


def test_machines_are_held_apart(path):
    MachineLock(path, 'ONE').take()
    assert MachineLock(path, 'ONE').is_held_elsewhere()
    assert not MachineLock(path, 'TWO').is_held_elsewhere()


@pytest.mark.parametrize('link', ['link.db', os.path.join('folder', 'robot.db')])
def test_a_link_to_a_store_is_that_store(tmp_path, path, link):
    os.symlink(str(tmp_path), str(tmp_path / 'folder'))
    os.symlink(path, str(tmp_path / 'link.db'))
    MachineLock(path, 'TASK').take()
    other = MachineLock(str(tmp_path / link), 'TASK')
    assert other.is_held_elsewhere()
    with pytest.raises(Held, match='{}: machine TASK is held by process'.format(link)):
        other.take()


def test_the_lock_of_a_killed_process_is_free(path):
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        MachineLock(path, 'TASK').take()
        os.write(writer, b'!')
        signal.pause()
    os.read(reader, 1)
    assert MachineLock(path, 'TASK').is_held_elsewhere()
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    MachineLock(path, 'TASK').take()


def test_where_no_lock_can_be_is_named(tmp_path):
    with pytest.raises(StoreError, match='cannot be locked'):
        MachineLock(str(tmp_path / 'no' / 'robot.db'), 'TASK').take()
