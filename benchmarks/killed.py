#!/usr/bin/env python3
"""Programs that are killed at random instants, and go on: what must hold, holds it?

    python3 benchmarks/killed.py [--kills N] [--seed S] [--jobs J] [--upstream PATH] [--check]

Each program runs a random tree of StateMachines, Sequences, Concurrences and Iterators with a
store, without ROS. It is killed by SIGKILL and begun again until it ends. The states write a
journal of their own, which is on the disk before they go on. It is held against what
doc/survive.md promises: no state that had ended runs again unless that was decided, none is left
out, each sees what the ones before it have left, the rates have each visit once, no number of an
event is used twice, what was promised is stored, no question is answered twice, no thread is left.
--upstream takes the smach found at PATH. With --check, 60 programs are killed on this engine, and
the exit status is 1 where anything is wrong. So it is without.
"""

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'unit' / 'support'))

MOST_SHOWN = 5
CHECKED = 60  # kills


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--kills', type=int, default=1000, help='(default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='(default: %(default)s)')
    parser.add_argument('--jobs', type=int, default=2, help='at a time (default: %(default)s)')
    parser.add_argument('--upstream', metavar='PATH', help='folder with an upstream smach')
    parser.add_argument('--check', action='store_true', help='only {} kills'.format(CHECKED))
    options = parser.parse_args()
    if options.upstream:
        sys.path.insert(0, options.upstream)
    kills = CHECKED if options.check else options.kills
    begun_s = time.monotonic()
    with ProcessPoolExecutor(options.jobs) as pool:
        shares = [
            kills // options.jobs + (number < kills % options.jobs)
            for number in range(options.jobs)
        ]
        courses = [
            course
            for found in pool.map(
                kill_share,
                ['{}-{}'.format(options.seed, number) for number in range(options.jobs)],
                shares,
            )
            for course in found
        ]
    return report(courses, time.monotonic() - begun_s)


def kill_share(seed: str, kills: int) -> list:
    """Kill programs in a process of this pool."""
    from quiet import silence
    from random_kills.killing import kill_many

    silence()
    return kill_many(seed, kills)


def report(courses: list, took_s: float) -> int:
    wrong = [(course.seed, text) for course in courses for text in course.wrong]
    for name, value in (
        ('kills', sum(course.kills for course in courses)),
        ('trees', len(courses)),
        ('resumed', sum(course.resumed for course in courses)),
        ('visits that were repeated', sum(course.states_again for course in courses)),
        ('trees that went wrong', len({seed for seed, _ in wrong})),
        ('seconds', round(took_s)),
    ):
        print('{:26} {:>8}'.format(name, value))
    for seed, text in wrong[:MOST_SHOWN]:
        print('tree {}: {}'.format(seed, text))
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())
