"""The process is killed at a random moment: at most the last second of its record is missing."""

import mmap
import multiprocessing
import os
import random
import shutil
import signal
import struct
import subprocess
import time

import pytest
from recorded import active, events, finished
from waiting import wait_for

from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder

# trial, number and wall time of the latest event whose emission returned, first time
PROGRESS = struct.Struct('<qqdd')
MAY_LACK_S = 1.0


def record(folder, shared, events_per_trial, pause_s):
    """Record trials until killed, noting in shared memory how far the machine got."""
    source = EventSource(print)
    recorder = TrialRecorder(folder)
    recorder.attach(source)
    began = time.time()
    source.observers.append(
        lambda event: shared.__setitem__(
            slice(0, PROGRESS.size),
            PROGRESS.pack(int(event.trial_id), event.seq, event.wall_time, began),
        )
    )
    for trial in range(10**9):
        source.begin_trial(str(trial))
        source.emit(EventKind.TRIAL_START, 'TOP')
        for _ in range(events_per_trial):
            source.emit(EventKind.STATE_START, 'TOP', state='A')
            if pause_s:
                time.sleep(pause_s)  # the pace of the machine
        source.emit(EventKind.TRIAL_END, 'TOP')


def record_and_kill(folder, after_s, events_per_trial, pause_s):
    """Returns the last PROGRESS before the kill."""
    shared = mmap.mmap(-1, mmap.PAGESIZE)
    process = multiprocessing.get_context('fork').Process(
        target=record, args=(str(folder), shared, events_per_trial, pause_s)
    )
    process.start()
    assert wait_for(lambda: PROGRESS.unpack_from(shared)[2] or not process.is_alive())
    assert process.is_alive()
    time.sleep(after_s)  # any moment will do: it is what these tests are about
    os.kill(process.pid, signal.SIGKILL)
    process.join(30.0)
    return PROGRESS.unpack_from(shared)


def mend_by_next_start(folder):
    """Start a recorder, and wait for what it mends in the background where the disk is slow."""
    assert TrialRecorder(str(folder), warn=pytest.fail).close(20.0)
    assert wait_for(lambda: active(folder) == just_made(folder))


def just_made(folder):
    """Files without a header, which a recorder leaves: another one may be just making them."""
    with os.scandir(str(folder)) as entries:
        return sorted(
            entry.path for entry in entries if entry.name.endswith('.active') and is_empty(entry)
        )


def is_empty(entry):
    try:
        return entry.stat().st_size == 0
    except FileNotFoundError:
        return False  # it was renamed meanwhile


def mend_by_rosbag_reindex(folder):
    for path in active(folder):
        shutil.move(path, path[: -len('.active')])
        subprocess.run(
            ['rosbag', 'reindex', '-q', path[: -len('.active')]], check=True, timeout=100
        )
        os.unlink(path[: -len('.bag.active')] + '.orig.bag')


def check(folder, trial, seq, wall_time, began):
    by_trial = {}
    for path in finished(folder):
        found = events(path)
        if found:  # killed between making the file and the first event
            assert [event.seq for event in found] == list(range(len(found)))
            by_trial[int(found[0].trial_id)] = found
    if not by_trial:
        assert wall_time - began <= MAY_LACK_S
        return
    last = by_trial[max(by_trial)][-1]
    assert last.wall_time >= wall_time - MAY_LACK_S
    # the kill may strike before the machine has noted it
    assert (int(last.trial_id), last.seq) <= (trial, seq + 1)
    for number in range(max(by_trial)):
        assert by_trial[number][-1].kind == EventKind.TRIAL_END, 'an earlier trial is not whole'


@pytest.mark.parametrize(
    'mend, events_per_trial, pause_s, rounds',
    [
        (mend_by_next_start, 10**9, 0.0, 3),  # one trial at full speed
        (mend_by_next_start, 10**9, 0.003, 3),
        (mend_by_next_start, 20, 0.001, 3),  # a trial every 20 ms
        (mend_by_rosbag_reindex, 10**9, 0.003, 2),
    ],
)
def test_at_most_the_last_second_is_missing(tmp_path, mend, events_per_trial, pause_s, rounds):
    for number in range(rounds):
        folder = tmp_path / str(number)
        after_s = random.uniform(0.05, 1.6)
        # shown where this test fails
        print('killed {:.6f} s after the first event'.format(after_s))
        killed = record_and_kill(folder, after_s, events_per_trial, pause_s)
        mend(folder)
        assert active(folder) == just_made(folder)
        check(folder, *killed)
