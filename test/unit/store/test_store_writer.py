"""Moments are written by a thread, and no disk holds the machine up for long."""

import sqlite3
import threading
import time

import pytest
from waiting import wait_for

from smach_oracle.store.codecs import Codecs
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile
from smach_oracle.store.store_writer import Ending, StoreWriter, merged

TRIAL = NewTrial('TASK', 'abc', ('id', 'description'), 5.0)


class FakeDisk:
    """In place of a store: hangs while `free` is not set, fails while `error` is."""

    path = 'fake.db'

    def __init__(self):
        self.free = threading.Event()
        self.free.set()
        self.error = ''
        self.seqs = []
        self.ended = None

    def begin_trial(self, trial):
        self._meet()
        return 1

    def add(self, trial, moments):
        self._meet()
        self.seqs += [moment.seq for moment in moments]

    def end_trial(self, trial, at, outcome):
        self.ended = (at, outcome)

    def _meet(self):
        self.free.wait()
        if self.error:
            raise sqlite3.OperationalError(self.error)


def moment(seq, name='key:a', value=0):
    return NewMoment(
        float(seq), seq, 'STATE_START', 'TASK', 'A', (Fact('TASK', name, Codecs().encode(value)),)
    )


@pytest.fixture
def warnings():
    return []


def test_a_moment_is_on_the_disk_when_commit_returns(tmp_path, warnings):
    path = str(tmp_path / 'robot.db')
    writer = StoreWriter(StoreFile(path), TRIAL, 10, warnings.append)
    for seq in range(20):
        assert writer.commit(moment(seq))
        assert [each.seq for each in StoreFile(path).moments(1)] == list(range(seq + 1))
    assert writer.close(Ending(9.0, 'done'))
    assert StoreFile(path).trials()[0].outcome == 'done'
    assert warnings == []


def test_a_disk_that_hangs_is_waited_for_once_and_catches_up(warnings):
    disk = FakeDisk()
    disk.free.clear()
    writer = StoreWriter(disk, TRIAL, 0.05, warnings.append)
    assert not writer.commit(moment(0))
    assert writer.is_behind
    begun = time.monotonic()
    for seq in range(1, 100):
        assert not writer.commit(moment(seq))
    assert time.monotonic() - begun < 99 * 0.05  # nobody has waited for each
    assert len(warnings) == 1 and 'took more than 0.05 s' in warnings[0]
    disk.free.set()
    wait_for(lambda: not writer.is_behind)
    assert disk.seqs == list(range(100))
    wait_for(lambda: len(warnings) == 2)
    assert 'all is stored again' in warnings[1]
    assert writer.commit(moment(100))
    assert writer.close()


def test_a_disk_that_fails_is_tried_again(warnings, monkeypatch):
    monkeypatch.setattr('smach_oracle.store.store_writer.RETRY_S', 0.01)
    disk = FakeDisk()
    disk.error = 'database or disk is full'
    writer = StoreWriter(disk, TRIAL, 10, warnings.append)
    assert not writer.commit(moment(0))
    assert 'database or disk is full' in warnings[0]
    disk.error = ''
    wait_for(lambda: not writer.is_behind)
    assert disk.seqs == [0]
    assert writer.close()


def test_who_must_stop_does_not_wait(warnings):
    disk = FakeDisk()
    disk.free.clear()
    writer = StoreWriter(disk, TRIAL, 60, warnings.append)
    begun = time.monotonic()
    assert not writer.commit(moment(0), lambda: True)
    assert time.monotonic() - begun < 30
    assert not writer.is_behind
    disk.free.set()
    assert writer.close()
    assert disk.seqs == [0]


def test_what_cannot_be_written_at_the_end_is_said(warnings, monkeypatch):
    monkeypatch.setattr('smach_oracle.store.store_writer.RETRY_S', 0.01)
    disk = FakeDisk()
    disk.error = 'disk I/O error'
    writer = StoreWriter(disk, TRIAL, 0.01, warnings.append)
    writer.commit(moment(0))
    assert not writer.close(Ending(9.0, 'done'))
    assert 'the end of the trial is not stored: disk I/O error' in warnings[-1]
    assert disk.ended is None


def test_moments_far_behind_are_merged():
    one = merged([moment(0, 'a', 1), moment(1, 'b', 2), moment(2, 'a', 3)])
    assert one.seq == 2
    assert {fact.name: fact.value.text for fact in one.facts} == {'a': '3', 'b': '2'}


def test_memory_stays_bounded_behind_a_disk_that_hangs(warnings, monkeypatch):
    monkeypatch.setattr('smach_oracle.store.store_writer.MOST_BEHIND', 10)
    disk = FakeDisk()
    disk.free.clear()
    writer = StoreWriter(disk, TRIAL, 0.01, warnings.append)
    for seq in range(1000):
        writer.commit(moment(seq))
    assert len(writer._waiting) <= 10
    disk.free.set()
    assert writer.close()
    assert disk.seqs[-1] == 999
