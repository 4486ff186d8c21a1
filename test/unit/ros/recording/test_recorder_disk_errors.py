"""A disk that is full, gone or hung: the robot goes on, the operator is told, and what was lost is
counted.
"""

import multiprocessing
import os
import resource
import shutil
import subprocess
import threading
import time
from pathlib import Path

import pytest
from recorded import active, events, finished, messages, numbers
from waiting import wait_for

from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording import bag_writer
from smach_oracle.ros.recording.recorder_status import RecorderState

TEXT = 'x' * 200  # of every event


class Watched:
    """A recorder, a machine's events, and everything the operator was told."""

    def __init__(self, folder, **settings):
        self.folder = str(folder)
        self.said, self.statuses = [], []
        self.recorder = TrialRecorder(
            self.folder,
            warn=self.said.append,
            say=self.said.append,
            on_status=self.statuses.append,
            **settings,
        )
        self.source = EventSource(pytest.fail)
        self.recorder.attach(self.source)
        self.told = 0

    def start(self, trial_id):
        self.source.begin_trial(trial_id)
        self.emit(EventKind.TRIAL_START)

    def emit(self, kind, count=1):
        for _ in range(count):
            self.source.emit(kind, 'TOP', text=TEXT)
        self.told += count

    def trial(self, trial_id, steps):
        self.start(trial_id)
        self.emit(EventKind.STATE_START, steps)
        self.emit(EventKind.TRIAL_END)

    def wait_for(self, state):
        assert wait_for(lambda: any(status.state == state for status in self.statuses)), (
            'the operator was never told {}'.format(state)
        )
        self.statuses.clear()

    def wait_for_disk(self, trial_id, count):
        """Until so many events of the trial can be read from its file."""

        def written():
            return sum(
                Path(path).read_bytes().count(TEXT.encode())
                for path in active(self.folder)
                if trial_id in path
            )

        assert wait_for(lambda: written() >= count), 'the events never reach the disk'

    def close(self):
        assert self.recorder.close(20.0)

    def recorded(self):
        return {path: numbers(path) for path in finished(self.folder)}

    def check_that_nothing_is_unaccounted_for(self):
        kept = sum(len(found) for found in self.recorded().values())
        assert kept + self.recorder.losses.events == self.told


def survive_full_disk(folder, fill, empty):
    """What must hold on any disk that fills up in one trial and has room again before the next."""
    watched = Watched(folder)
    watched.trial('before', 10)
    watched.start('full')
    watched.emit(EventKind.STATE_START, 200)
    watched.wait_for_disk('full', 201)
    fill()
    began = time.monotonic()
    watched.emit(EventKind.STATE_START, 3000)
    assert time.monotonic() - began < 20.0  # the robot was not held up
    watched.wait_for(RecorderState.DROPPING)
    watched.emit(EventKind.TRIAL_END)
    empty()
    watched.trial('after', 10)
    watched.close()
    watched.check_that_nothing_is_unaccounted_for()
    by_trial = {events(path)[0].trial_id: path for path in finished(folder)}
    assert numbers(by_trial['before']) == list(range(12))
    assert numbers(by_trial['after']) == list(range(12))
    assert numbers(by_trial['full'])[:201] == list(range(201))
    assert active(folder) == []
    lost = watched.recorder.losses.events
    assert lost > 0
    assert messages(by_trial['after'], '/record/status')[0].events_lost_in_total == lost
    assert any('not recorded any more' in text and str(folder) in text for text in watched.said)
    assert any('recorded again' in text and str(lost) in text for text in watched.said)


def in_child(work, *args):
    """Run in a forked process: limits set there do not reach the test runner."""
    receiver, sender = multiprocessing.Pipe(False)

    def child():
        try:
            work(*args)
            sender.send('')
        except BaseException as err:
            sender.send('{!r}'.format(err))

    process = multiprocessing.get_context('fork').Process(target=child)
    process.start()
    assert receiver.poll(100.0), 'the child hangs'
    assert receiver.recv() == ''
    process.join(10.0)


def test_the_robot_goes_on_when_files_may_not_grow(tmp_path):
    """EFBIG stands in for ENOSPC where nothing may be mounted."""

    def limited():
        def limit(size):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

        survive_full_disk(tmp_path, lambda: limit(100_000), lambda: limit(resource.RLIM_INFINITY))

    in_child(limited)


@pytest.fixture
def small_disk(tmp_path):
    folder = tmp_path / 'disk'
    folder.mkdir()
    mount = subprocess.run(
        ['mount', '-t', 'tmpfs', '-o', 'size=400k', 'tmpfs', str(folder)], stderr=subprocess.PIPE
    )
    if mount.returncode:
        pytest.skip('nothing may be mounted here: {}'.format(mount.stderr.decode().strip()))
    yield folder
    subprocess.run(['umount', '-l', str(folder)], check=True)


def test_the_robot_goes_on_when_the_disk_is_full(small_disk):
    def fill():
        with open(str(small_disk / 'other'), 'wb', buffering=0) as other:
            try:
                while True:
                    other.write(bytes(4096))
            except OSError:
                pass

    survive_full_disk(small_disk, fill, (small_disk / 'other').unlink)


def test_a_trial_goes_on_in_a_new_bag_when_the_disk_works_again(tmp_path, monkeypatch):
    watched = Watched(tmp_path)
    watched.start('long')
    watched.emit(EventKind.STATE_START, 20)
    watched.wait_for_disk('long', 21)
    real = os.pwrite

    def broken(*_):
        raise OSError(5, 'Input/output error')

    monkeypatch.setattr(bag_writer.os, 'pwrite', broken)
    watched.emit(EventKind.STATE_START, 20)
    watched.wait_for(RecorderState.DROPPING)
    monkeypatch.setattr(bag_writer.os, 'pwrite', real)
    assert wait_for(
        lambda: (
            watched.emit(EventKind.STATE_START)
            or len(active(tmp_path)) + len(finished(tmp_path)) == 2
        )
    )
    watched.emit(EventKind.TRIAL_END)
    watched.close()
    watched.check_that_nothing_is_unaccounted_for()
    first, second = sorted(watched.recorded().values())
    assert first == list(range(21))
    assert second == list(range(second[0], watched.told)) and second[0] > 21
    assert {event.trial_id for path in finished(tmp_path) for event in events(path)} == {'long'}


def test_the_robot_goes_on_when_the_folder_vanishes(tmp_path):
    folder = tmp_path / 'bags'
    watched = Watched(folder)
    watched.start('vanished')
    watched.emit(EventKind.STATE_START, 10)
    watched.wait_for_disk('vanished', 11)
    shutil.rmtree(str(folder))
    watched.emit(EventKind.TRIAL_END)
    watched.wait_for(RecorderState.DROPPING)
    watched.trial('dropped', 10)
    assert wait_for(lambda: watched.recorder.losses.events >= 24)
    folder.mkdir()
    watched.trial('recorded', 10)
    watched.close()
    watched.check_that_nothing_is_unaccounted_for()
    (path,) = finished(folder)
    assert events(path)[0].trial_id == 'recorded'
    assert watched.recorder.losses.events == 12 + 12


def test_a_vanished_folder_is_noticed_in_mid_trial(tmp_path):
    folder = tmp_path / 'bags'
    watched = Watched(folder)
    watched.start('vanished')
    watched.wait_for(RecorderState.RECORDING)
    shutil.rmtree(str(folder))
    assert wait_for(
        lambda: (
            watched.emit(EventKind.STATE_START)
            or any(status.state == RecorderState.DROPPING for status in watched.statuses)
        )
    )
    watched.close()
    watched.check_that_nothing_is_unaccounted_for()


@pytest.fixture
def hanging_disk(monkeypatch):
    """Writes hang from `begin()` on until `end()`."""
    works = threading.Event()
    works.set()
    real = os.pwrite

    def pwrite(*args):
        assert works.wait(60.0)
        return real(*args)

    monkeypatch.setattr(bag_writer.os, 'pwrite', pwrite)

    class FakeHang:
        begin, end = works.clear, works.set

    yield FakeHang
    works.set()


def test_a_hung_disk_holds_the_robot_up_only_for_a_while(tmp_path, hanging_disk):
    watched = Watched(tmp_path, max_events=20, hung_after_s=0.5)
    watched.start('hung')
    hanging_disk.begin()
    began = time.monotonic()
    watched.emit(EventKind.STATE_START, 500)
    assert 0.4 < time.monotonic() - began < 10.0
    watched.wait_for(RecorderState.DROPPING)
    began = time.monotonic()
    watched.emit(EventKind.STATE_START, 500)
    assert time.monotonic() - began < 10.0  # known to hang: not waited for again at each
    hanging_disk.end()
    assert wait_for(lambda: [text for text in watched.said if 'answers again' in text])
    watched.emit(EventKind.TRIAL_END)
    watched.close()
    watched.check_that_nothing_is_unaccounted_for()
    assert [text for text in watched.said if 'hung for more than 0.5 s' in text]
    assert [text for text in watched.said if 'answers again' in text]
    (path,) = finished(tmp_path)
    assert numbers(path)[-1] == 1001
    assert messages(path, '/record/status')[-1].events_lost == watched.recorder.losses.events > 900


def test_closing_does_not_wait_for_a_hung_disk(tmp_path, hanging_disk):
    watched = Watched(tmp_path)
    watched.start('hung')
    hanging_disk.begin()
    watched.emit(EventKind.TRIAL_END)
    began = time.monotonic()
    assert watched.recorder.close() is False
    assert time.monotonic() - began < 10.0  # one second, on an idle machine
    assert any('in time' in text for text in watched.said)
    hanging_disk.end()
    assert watched.recorder.close(20.0)
    assert watched.recorded()
