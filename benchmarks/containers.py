#!/usr/bin/env python3
"""The cost of a container in a wrapped machine, in executions of the same one without an oracle.

    python3 benchmarks/containers.py [--check] [--rounds N]

An item of an Iterator, whose state is plain or a machine of two states; 200 small machines, one
after the other in one machine; a Concurrence of five plain states. Nothing fails, loggers are
silenced, and nobody observes. It measures the processor's time, in rounds that alternate, and the
best of each counts, so that neighbours on the machine do not. With --check the exit status is 1
above a limit.
"""

import argparse
import sys
import time
from typing import Callable, List, NamedTuple

from oracle_overhead import Fixed, silence

import smach
from smach_oracle.oracle import OracleContainer

ITEMS, NESTED, BRANCHES, REPEATS = 2000, 200, 5, 20


class Row(NamedTuple):
    """A container, how many of its kind an execution has, and the ratio that is too much."""

    name: str
    make: Callable[[], smach.StateMachine]
    count: int
    limit: float


class Counted(smach.State):
    """Ends with `again` until it has been visited `REPEATS` times."""

    def __init__(self) -> None:
        smach.State.__init__(self, outcomes=['again', 'over'])
        self._visits = 0

    def execute(self, ud: object) -> str:
        """Count the visit."""
        self._visits = (self._visits + 1) % REPEATS
        return 'again' if self._visits else 'over'


def chain(**states: smach.State) -> smach.StateMachine:
    """A machine of states in a row."""
    machine = smach.StateMachine(outcomes=['done'])
    labels = list(states)
    with machine:
        for label, following in zip(labels, labels[1:] + ['done']):
            (outcome,) = states[label].get_registered_outcomes()
            smach.StateMachine.add(label, states[label], {outcome: following})
    return machine


def small() -> smach.StateMachine:
    """A machine of two states."""
    return chain(A=Fixed('ok'), B=Fixed('ok'))


def items_of(state: smach.State) -> smach.StateMachine:
    """A machine with an Iterator."""
    iterator = smach.Iterator(
        outcomes=['done'],
        input_keys=[],
        output_keys=[],
        it=range(ITEMS),
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        loops = list(state.get_registered_outcomes())
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=loops)
    return chain(ALL=iterator)


def branches() -> smach.StateMachine:
    """A machine that executes a Concurrence again and again."""
    concurrence = smach.Concurrence(outcomes=['done'], default_outcome='done')
    with concurrence:
        for number in range(BRANCHES):
            smach.Concurrence.add('B{}'.format(number), Fixed('ok'))
    machine = smach.StateMachine(outcomes=['over'])
    with machine:
        smach.StateMachine.add('ALL', concurrence, {'done': 'COUNT'})
        smach.StateMachine.add('COUNT', Counted(), {'again': 'ALL'})
    return machine


# wanted: 2.5, and 1.15 for a Concurrence. Reached are 2.5 to 2.8, 2.5 to 2.6, 2.6 to 3.1 and 1.0 to
# 1.2, and beside other work up to 3.2 for a small machine and 1.34. The limits are a fifth above
# what is wanted. That of a small machine is not: what it takes bare differs by 5.4 to 8 us from one
# process to the next, and a tenth is left above the 3.1
ROWS = (
    Row('item of a plain state', lambda: items_of(Fixed('ok')), ITEMS, 3.0),
    Row('item of a machine', lambda: items_of(small()), ITEMS, 3.0),
    Row(
        'small machine',
        lambda: chain(**{'S{}'.format(number): small() for number in range(NESTED)}),
        NESTED,
        3.4,
    ),
    Row('Concurrence of five', branches, REPEATS, 1.38),
)


def seconds(machine: smach.StateMachine) -> float:
    """The processor's time for an execution."""
    begin = time.process_time()
    machine.execute()
    return time.process_time() - begin


def costs(row: Row, rounds: int) -> List[float]:
    """Seconds of one such container, without and with an oracle."""
    machines = (row.make(), OracleContainer.wrap(row.make()))
    measured = [[seconds(machine) for machine in machines] for _ in range(rounds)]
    return [min(column) / row.count for column in zip(*measured)]


def main() -> int:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument(
        '--check', action='store_true', help='exit with status 1 where a limit is missed'
    )
    parser.add_argument('--rounds', type=int, default=40, help='rounds; the best counts')
    args = parser.parse_args()
    silence()
    print('engine: {}'.format(smach.__file__))
    missed = False
    for row in ROWS:
        bare, wrapped = costs(row, args.rounds)
        missed |= wrapped / bare > row.limit
        print(
            '{:24} {:8.2f} us, wrapped {:8.2f} us: {:5.2f} times (limit {:g})'.format(
                row.name, bare * 1e6, wrapped * 1e6, wrapped / bare, row.limit
            )
        )
    return 1 if args.check and missed else 0


if __name__ == '__main__':
    sys.exit(main())
