#!/usr/bin/env python3
"""The cost of a failure-free transition of a machine, in steps of the bare loop over the same two
states.

    python3 benchmarks/smach_engine.py [--check] [--upstream PATH] [--steps N] [--rounds N]
    [--transitions N]

The bare loop is `label = transitions[label][states[label].execute(ud)]`. Loggers are silenced with
functions that do nothing. The second row reads and writes userdata in each state (`ud.counter =
ud.counter + 1`) and is held against the same bare loop. Everything is measured in turn in one
process, many short rounds; a ratio is that of the medians of the fastest quarter of the rounds, so
that neighbours on the machine do not count. --upstream measures the smach found at PATH as well, in
a process of its own with a bare loop of its own. --check ends with status 1 where a limit is
broken, the last one being that memory stays flat over --transitions transitions.
"""

import argparse
import itertools
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from typing import Callable, Dict, List, Optional

from quiet import in_bare_steps, silence

SRC = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, 'src')

# Ratio to the bare loop that each row may reach.
LIMITS = {
    'outcome only': in_bare_steps(12.0),
    'userdata read and written': in_bare_steps(25.0),
}
MEMORY_LIMIT_KB = 1024


def two_states(smach, with_userdata: bool) -> Dict[str, object]:
    """States A and B that end with outcomes x and y."""

    class Fixed(smach.State):
        def __init__(self, outcome):
            smach.State.__init__(self, outcomes=[outcome])
            self.fixed = outcome

        def execute(self, ud):
            return self.fixed

    class Counting(smach.State):
        def __init__(self, outcome):
            smach.State.__init__(self, outcomes=[outcome], io_keys=['counter'])
            self.fixed = outcome

        def execute(self, ud):
            ud.counter = ud.counter + 1
            return self.fixed

    kind = Counting if with_userdata else Fixed
    return {'A': kind('x'), 'B': kind('y')}


def bare_loop(smach) -> Callable[[int], float]:
    """A function that runs n bare steps and returns the seconds a step takes."""
    states = two_states(smach, False)
    transitions = {'A': {'x': 'B'}, 'B': {'y': 'A'}}

    def run(count: int) -> float:
        ud: Dict[str, object] = {}
        label = 'A'
        begin = time.perf_counter()
        for _ in range(count):
            label = transitions[label][states[label].execute(ud)]  # type: ignore[attr-defined]
        return (time.perf_counter() - begin) / count

    return run


def machine_loop(smach, with_userdata: bool) -> Callable[[int], float]:
    """A function that lets a machine make n transitions and returns the seconds one takes."""
    states = two_states(smach, with_userdata)
    machine = smach.StateMachine(outcomes=['done'])
    machine.userdata.counter = 0
    with machine:
        smach.StateMachine.add('A', states['A'], {'x': 'B'})
        smach.StateMachine.add('B', states['B'], {'y': 'A'})

    def run(count: int) -> float:
        smach.set_shutdown_check(
            itertools.chain(itertools.repeat(False, count), itertools.repeat(True)).__next__
        )
        begin = time.perf_counter()
        machine.execute()
        return (time.perf_counter() - begin) / count

    return run


def measure(steps: int, rounds: int) -> Dict[str, float]:
    """Seconds a step, of the bare loop and of each row."""
    smach = silence()
    loops = {
        'bare loop': bare_loop(smach),
        'outcome only': machine_loop(smach, False),
        'userdata read and written': machine_loop(smach, True),
    }
    times: Dict[str, List[float]] = {name: [] for name in loops}
    for _ in range(rounds):
        for name, loop in loops.items():
            times[name].append(loop(steps))
    return {
        name: statistics.median(sorted(taken)[: max(1, rounds // 4)])
        for name, taken in times.items()
    }


def memory_growth_kb(transitions: int) -> int:
    """Return the growth of the process (kB) while a machine made that many transitions."""
    loop = machine_loop(silence(), True)
    loop(10000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    loop(transitions)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before


def measure_in_process(path: str, steps: int, rounds: int) -> Dict[str, float]:
    """The same for the smach at `path`."""
    command = [
        sys.executable,
        os.path.abspath(__file__),
        '--json',
        '--steps',
        str(steps),
        '--rounds',
        str(rounds),
    ]
    done = subprocess.run(
        command, env=dict(os.environ, PYTHONPATH=path), stdout=subprocess.PIPE, check=True
    )
    times: Dict[str, float] = json.loads(done.stdout.decode())
    return times


def print_table(ours: Dict[str, float], upstream: Optional[Dict[str, float]]) -> None:
    """Rows of nanoseconds and ratios, as in doc/inside/smach_engine.md."""
    print(
        '| a step of | ns | x bare loop | limit |%s'
        % (' upstream ns | upstream x |' if upstream else '')
    )
    print('|---|---|---|---|%s' % ('---|---|' if upstream else ''))
    for name in ours:
        row = '| %s | %.0f | %.1f | %s |' % (
            name,
            ours[name] * 1e9,
            ours[name] / ours['bare loop'],
            LIMITS.get(name, ''),
        )
        if upstream:
            row += ' %.0f | %.1f |' % (upstream[name] * 1e9, upstream[name] / upstream['bare loop'])
        print(row)


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description='Cost of a transition, in steps of the bare loop.')
    parser.add_argument(
        '--check', action='store_true', help='end with status 1 where a limit is broken'
    )
    parser.add_argument(
        '--upstream', metavar='PATH', help='folder with an upstream smach to measure too'
    )
    parser.add_argument(
        '--steps', type=int, default=3000, help='steps a round (default: %(default)s)'
    )
    parser.add_argument('--rounds', type=int, default=200, help='rounds (default: %(default)s)')
    parser.add_argument(
        '--transitions',
        type=int,
        default=10000000,
        help='transitions for the memory check (default: %(default)s)',
    )
    parser.add_argument('--json', action='store_true', help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> int:
    """Measure, print, check."""
    arguments = parse_arguments()
    if arguments.json:
        print(json.dumps(measure(arguments.steps, arguments.rounds)))
        return 0
    ours = measure_in_process(SRC, arguments.steps, arguments.rounds)
    upstream = arguments.upstream and measure_in_process(
        arguments.upstream, arguments.steps, arguments.rounds
    )
    print_table(ours, upstream or None)
    if not arguments.check:
        return 0
    broken = [name for name, limit in LIMITS.items() if ours[name] > limit * ours['bare loop']]
    sys.path.insert(0, SRC)
    grown_kb = memory_growth_kb(arguments.transitions)
    print(
        'memory: %d kB more after %d transitions (limit %d)'
        % (grown_kb, arguments.transitions, MEMORY_LIMIT_KB)
    )
    if grown_kb > MEMORY_LIMIT_KB:
        broken.append('memory')
    for name in broken:
        print('LIMIT BROKEN: %s' % name, file=sys.stderr)
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())
