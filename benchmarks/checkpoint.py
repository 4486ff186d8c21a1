#!/usr/bin/env python3
"""What it costs to store a moment at each transition, and how long a disk that hangs holds one up.

    python3 benchmarks/checkpoint.py [--check] [--transitions N] [--folder FOLDER]

A two-state loop with 10 keys and 2 kB of userdata, of which each visit writes one, runs with a
store and without. The difference is told as processor time of the process, by transition, and as
time on the wall. FULL and NORMAL depend on the disk of FOLDER. With --check the exit status is 1
where OFF takes more than 150 us of the processor.
"""
import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Optional, Tuple

from oracle_overhead import silence

import smach
from smach_oracle.oracle import OracleContainer

LIMIT_US = 150.0
KEYS, BYTES = 10, 2000


class Writing(smach.State):
    """Gives one key after the other a new value."""

    def __init__(self, left):
        smach.State.__init__(self, ['again', 'done'], ['k%d' % i for i in range(KEYS)],
                             ['k%d' % i for i in range(KEYS)])
        self._left = left

    def execute(self, userdata):
        self._left[0] -= 1
        userdata['k%d' % (self._left[0] % KEYS)] = value(self._left[0])
        return 'again' if self._left[0] > 0 else 'done'


def value(number):
    """A pose with a name: 200 bytes of JSON."""
    size = BYTES // KEYS
    return {'name': 'object_%d' % number, 'pose': [0.125] * 7, 'note': 'x' * (size - 80)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--check', action='store_true')
    parser.add_argument('--transitions', type=int, default=5000, help='(default: %(default)s)')
    parser.add_argument('--folder', help='where the stores are made (default: a temporary one)')
    options = parser.parse_args()
    silence()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        return report(Path(folder), options)


def report(folder: Path, options: argparse.Namespace) -> int:
    print('{:>10} {:>16} {:>14}'.format('', 'processor, us', 'wall, us'))
    bare = measure(options.transitions)
    cost_us = 0.0
    for synchronous in ('OFF', 'NORMAL', 'FULL'):
        transitions = options.transitions if synchronous == 'OFF' else options.transitions // 5
        stored = measure(transitions, str(folder / (synchronous + '.db')), synchronous)
        processor, wall = (1e6 * (one - other) for one, other in zip(stored, bare))
        print('{:>10} {:>16.0f} {:>14.0f}'.format(synchronous, processor, wall))
        if synchronous == 'OFF':
            cost_us = processor
    print('by transition, {} keys, {} bytes; limit {:g} us of the processor with OFF'.format(
        KEYS, BYTES, LIMIT_US))
    return int(options.check and cost_us > LIMIT_US)


def measure(transitions: int, store: Optional[str] = None, synchronous: str = 'OFF'
            ) -> Tuple[float, float]:
    """Return the processor time and the time on the wall of one transition, s."""
    left = [transitions]
    machine = smach.StateMachine(['done'])
    for number in range(KEYS):
        machine.userdata['k%d' % number] = value(number)
    with machine:
        smach.StateMachine.add('A', Writing(left), {'again': 'B'})
        smach.StateMachine.add('B', Writing(left), {'again': 'A'})
    settings = {} if store is None else {'checkpoint': store,
                                         'checkpoint_synchronous': synchronous}
    wrapped = OracleContainer.wrap(machine, settings=settings)
    processor, wall = time.process_time(), time.perf_counter()
    wrapped.execute()
    return ((time.process_time() - processor) / transitions,
            (time.perf_counter() - wall) / transitions)


if __name__ == '__main__':
    sys.exit(main())
