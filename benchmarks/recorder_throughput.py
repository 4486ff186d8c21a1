#!/usr/bin/env python3
"""The speed of a wrapped machine while it is recorded, and whether anything is lost or piles up in
memory.

A two-state loop without work in its states: the executive at its full speed, the worst case for a
recorder. With --trials many short trials follow each other, one bag each, and the exit status is 1
where a later trial takes more memory, files, threads or time than an early one. With --check the
recorder and rosbags' writer take the same events in turns, and the exit status is 1 where the
recorder takes more processor time than its limit. Needs no ROS master. `recorder_throughput.py
--help` shows the options.
"""

import argparse
import glob
import os
import resource
import shutil
import statistics
import sys
import tempfile
import threading
import time
from typing import Any, Callable, Dict, List, Optional

from rosbags.rosbag1 import Reader, Writer

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import Event
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording.event_packing import EVENT_TYPE, pack_event

# what the last tenth of many trials may take of what the first took
MOST_GROWTH = {'ms per trial': 2.0, 'peak memory, MB': 1.1, 'threads': 1.0, 'open files': 1.2}

# --check: events of a trial, rounds, and the processor time of the recorder by that of rosbags'
# writer, which is given packed events and has neither a queue nor a disk to wait for
CHECKED_EVENTS, ROUNDS = 6000, 7
MOST_BY_ROSBAGS = 1.5


class Step(smach.State):
    """Goes on until the machine has taken enough transitions."""

    left = 0

    def __init__(self) -> None:
        super().__init__(outcomes=['next', 'done'])

    def execute(self, userdata: Any) -> str:
        Step.left -= 1
        return 'next' if Step.left > 0 else 'done'


def make_machine() -> smach.StateMachine:
    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        smach.StateMachine.add('A', Step(), {'next': 'B'})
        smach.StateMachine.add('B', Step(), {'next': 'A'})
    OracleContainer.wrap(machine, name='TOP')
    return machine


def run(transitions: int, observe: Optional[Callable[[Event], None]] = None) -> float:
    """Returns the processor seconds that one trial takes, in all threads."""
    machine = make_machine()
    if observe is not None:
        machine.events.observers.append(observe)
    Step.left = transitions
    began = time.process_time()
    machine.execute()
    return time.process_time() - began


class Count:
    """An observer that only counts: what observing itself costs."""

    def __init__(self) -> None:
        self.events = 0

    def __call__(self, event: Event) -> None:
        self.events += 1


def recorded_numbers(folder: str) -> List[int]:
    """Sequence numbers of the events in the only bag, in the order of the bag."""
    (path,) = glob.glob(os.path.join(folder, '*.bag'))
    numbers = []
    with Reader(path) as reader:
        for _, _, data in reader.messages(
            [item for item in reader.connections if item.topic.endswith('events')]
        ):
            # uint8 kind, Header (seq, stamp, frame_id), float64 wall_time, string trial_id, uint64
            # seq
            start = 1 + 12 + 4 + int.from_bytes(data[13:17], 'little') + 8
            start += 4 + int.from_bytes(data[start : start + 4], 'little')
            numbers.append(int.from_bytes(data[start : start + 8], 'little'))
    return numbers


def peak_rss_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def growth_of(trials: int, folder: str) -> int:
    """Run many trials of one process. Compare what they take with what the first tenth took."""
    recorder = TrialRecorder(folder + '/bags')
    tenth = max(trials // 10, 1)
    readings: List[Dict[str, float]] = []
    for _ in range(10):
        begin = time.perf_counter()
        for _ in range(tenth):
            run(5, recorder)
        readings.append(
            {
                'ms per trial': (time.perf_counter() - begin) / tenth * 1e3,
                'peak memory, MB': peak_rss_mb(),
                'threads': threading.active_count(),
                'open files': len(os.listdir('/proc/self/fd')),
            }
        )
    closed = recorder.close(60.0)
    bags = len(glob.glob(folder + '/bags/*.bag'))
    print('{} trials, {} bags'.format(10 * tenth, bags))
    early, late, grown = readings[0], readings[-1], False
    for name, most in MOST_GROWTH.items():
        ratio = late[name] / early[name]
        grown = grown or ratio > most
        print(
            '{:<16} {:8.2f} at a tenth {:8.2f} at the end {:6.2f} x (at most {:.1f})'.format(
                name, early[name], late[name], ratio, most
            )
        )
    return 0 if closed and bags == 10 * tenth and not grown else 1


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--transitions',
        type=int,
        default=100_000,
        help='of the recorded trial (default: %(default)s)',
    )
    parser.add_argument(
        '--folder', help='for the bags, to try a certain disk (default: that for temporary files)'
    )
    parser.add_argument(
        '--trials', type=int, default=0, help='run so many short trials instead, e.g. 10000'
    )
    parser.add_argument(
        '--check',
        action='store_true',
        help="record {} events beside rosbags' writer instead".format(CHECKED_EVENTS),
    )
    args = parser.parse_args()
    smach.set_loggers(*[lambda text: None] * 4)
    folder = tempfile.mkdtemp(dir=args.folder)
    try:
        if args.check:
            return beside_rosbags(folder)
        return growth_of(args.trials, folder) if args.trials else measure(args.transitions, folder)
    finally:
        shutil.rmtree(folder)


def beside_rosbags(folder: str) -> int:
    """Have the recorder and rosbags' writer write the same events, in turns."""
    events: List[Event] = []
    run(CHECKED_EVENTS // 2, events.append)
    ours, theirs = [], []
    for turn in range(ROUNDS + 1):  # the first one imports, and is not counted
        ours.append(recorder_cpu_s(events, '{}/ours_{}'.format(folder, turn)))
        theirs.append(rosbags_cpu_s(events, '{}/theirs_{}.bag'.format(folder, turn)))
    for name, seconds in (('the recorder', ours), ("rosbags' writer", theirs)):
        print(
            '{:<16} {:6.2f} us of processor time an event'.format(
                name, statistics.median(seconds[1:]) / len(events) * 1e6
            )
        )
    ratio = statistics.median(mine / other for mine, other in zip(ours[1:], theirs[1:]))
    print('{:.2f} times as much (at most {})'.format(ratio, MOST_BY_ROSBAGS))
    return 0 if ratio <= MOST_BY_ROSBAGS else 1


def recorder_cpu_s(events: List[Event], folder: str) -> float:
    """Return the processor time (s) in which all threads of a recorder write the events."""
    recorder = TrialRecorder(folder)
    began = time.process_time()
    for event in events:
        recorder(event)
    closed = recorder.close(60.0)
    took = time.process_time() - began
    if not closed or recorder.losses.events:
        raise RuntimeError('not everything was recorded')
    return took


def rosbags_cpu_s(events: List[Event], path: str) -> float:
    """Return that of rosbags' writer, with the recorder's packing of an event."""
    began = time.process_time()
    with Writer(path) as writer:
        connection = writer.add_connection(
            '/oracle/events',
            'smach_oracle/msg/OracleEvent',
            msgdef=EVENT_TYPE.definition,
            md5sum=EVENT_TYPE.md5sum,
        )
        for event in events:
            writer.write(connection, int(event.wall_time * 1e9), pack_event(event, (0, 0)))
    return time.process_time() - began


def measure(transitions: int, folder: str) -> int:
    bare_s = run(transitions)
    count = Count()
    counted_s = run(transitions, count)
    run(1000, TrialRecorder(folder + '/warm_up'))
    before_mb = peak_rss_mb()
    recorder = TrialRecorder(folder + '/bags')
    recorded_s = run(transitions, recorder)
    closing = time.perf_counter()
    closed = recorder.close(60.0)
    closing_s = time.perf_counter() - closing
    grown_mb = peak_rss_mb() - before_mb
    whole = recorded_numbers(folder + '/bags') == list(range(count.events)) and closed
    print(
        '{} transitions, {} events, {:.1f} MB of bag'.format(
            transitions, count.events, bag_mb(folder + '/bags')
        )
    )
    for name, seconds in (
        ('no observer', bare_s),
        ('a counting observer', counted_s),
        ('recorded', recorded_s),
    ):
        print(
            '{:<24} {:8.2f} us per transition {:10.0f} events/s {:7.1f} x'.format(
                name, seconds / transitions * 1e6, count.events / seconds, seconds / bare_s
            )
        )
    print('written to the end {:.2f} s after the trial'.format(closing_s))
    print(
        'events lost: {}; numbering without a gap: {}'.format(
            recorder.losses.events, 'yes' if whole else 'NO'
        )
    )
    print('memory: peak grew by {:.1f} MB while recording'.format(grown_mb))
    return 0 if whole else 1


def bag_mb(folder: str) -> float:
    return sum(os.path.getsize(path) for path in glob.glob(folder + '/*.bag')) / 2**20


if __name__ == '__main__':
    sys.exit(main())
