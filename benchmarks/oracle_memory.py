#!/usr/bin/env python3
"""Whether memory stays flat over ten million transitions under an oracle.

    python3 benchmarks/oracle_memory.py [--check] [--transitions N]

A two-state loop whose userdata is written at each visit runs N transitions; the resident memory is
read after a tenth of them and at the end. With --check the exit status is 1 where it grew by more
than 1 MiB in between.
"""

import argparse
import itertools
import sys
import time

from quiet import silence

import smach
from smach_oracle.oracle import OracleContainer

LIMIT_KIB = 1024


class Writing(smach.State):
    """Writes a new object to the userdata, and fails once in ten thousand visits."""

    def __init__(self, fails: bool) -> None:
        smach.State.__init__(self, outcomes=['ok', 'aborted'], output_keys=['x'])
        self._visits = 0
        self._fails = fails

    def execute(self, ud: smach.UserData) -> str:
        """Write."""
        self._visits += 1
        ud.x = float(self._visits)
        return 'aborted' if self._fails and self._visits % 10000 == 0 else 'ok'


def resident_kib() -> int:
    """Resident memory of this process, KiB."""
    with open('/proc/self/status', encoding='ascii') as status:
        return next(int(line.split()[1]) for line in status if line.startswith('VmRSS:'))


def main() -> int:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--check', action='store_true', help='exit with status 1 where memory grew')
    parser.add_argument('--transitions', type=int, default=10**7, help='transitions in all')
    args = parser.parse_args()
    silence()
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Writing(False), {'ok': 'B'})
        smach.StateMachine.add('B', Writing(True), {'ok': 'A'})
    OracleContainer.wrap(machine, settings={'max_recoveries': 10**9, 'policy': 'prose'})
    readings = []

    def read(last: bool) -> bool:
        readings.append(resident_kib())
        return last

    tenth = args.transitions // 10
    smach.set_shutdown_check(
        itertools.chain(
            itertools.repeat(False, tenth),
            map(read, [False]),
            itertools.repeat(False, args.transitions - tenth),
            map(read, [True]),
            itertools.repeat(True),
        ).__next__
    )
    begin = time.perf_counter()
    machine.execute()
    elapsed_s = time.perf_counter() - begin
    failures = sum(row.failures for row in machine.rates())
    print('engine: {}'.format(smach.__file__))
    print(
        '{} transitions in {:.0f} s, {} of them failures; resident {} KiB after a tenth, {} KiB '
        'at the end '
        '(may grow by {})'.format(
            args.transitions, elapsed_s, failures, readings[0], readings[-1], LIMIT_KIB
        )
    )
    return 1 if args.check and readings[-1] - readings[0] > LIMIT_KIB else 0


if __name__ == '__main__':
    sys.exit(main())
