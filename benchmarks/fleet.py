#!/usr/bin/env python3
"""Ten robots, one shared expert server and two consoles, while any of them is killed at random.

    python3 benchmarks/fleet.py [--robots N] [--kills N] [--seed S]

Each robot is a process under oracle_run --checkpoint --resume=recover, all with one store, on a
master of its own. It asks in each round. The deadline is 20 s instead of 300 s, and a claim holds
3 s instead of 15 s. What is killed is drawn: a robot (half of the kills), the server, a console
with its expert, an interface, the action server, the master; everything at once within the first
tenth. Held against what must hold: each question was closed once, by an answer that fits its robot,
or as it expired; each robot's rounds are told in turn, and it comes to its end; nothing is open or
claimed at the server then. Memory, threads and open files of server and of the console that lives
on are told as the most within the second and within the last tenth of the kills. They are flat
where memory has not grown by more than a tenth, and threads and files by no more than two a robot:
they come and go with its connections. The exit status is 1 where something does not hold.
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Dict, List

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'rostest'))

WATCHED = ('server', 'console_1')
DEADLINE_S, LEASE_S, LONGEST_S = 20.0, 3.0, 3.0
MORE_MEMORY = 1.1  # what counts as flat: a tenth more
MORE_A_ROBOT = 2  # threads or files: what counts as flat
LEFT = """
import rospy
from smach_oracle.msg import OpenQueries
rospy.init_node('left', anonymous=True)
print('LEFT', len(rospy.wait_for_message('{}/open', OpenQueries, 60.0).queries))
"""


def main() -> int:
    from killed_fleet import KilledFleet

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--robots', type=int, default=10, help='(default: %(default)s)')
    parser.add_argument('--kills', type=int, default=100, help='(default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='(default: %(default)s)')
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no program is left
    begun_s = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        fleet = KilledFleet(folder, options.robots, 2, DEADLINE_S, LEASE_S)
        fleet.start()
        try:
            samples: List[Dict[str, Dict[str, int]]] = []
            killed = Killed(options)
            fleet.run_under_kills(
                killed.draw,
                options.kills,
                options.seed,
                LONGEST_S,
                lambda number: samples.append(sample(fleet)),
            )
            found = fleet.judge()
            left = open_questions(fleet.env)
        finally:
            fleet.stop()
    wrong = list(found.wrong)
    if left != 'LEFT 0':
        wrong.append('questions at the server: {}'.format(left))
    for name, value in (
        ('robots', options.robots),
        ('kills', options.kills),
        *sorted(killed.counts.items()),
        ('rounds', found.rounds),
        ('questions', found.questions),
        ('answered', found.answered),
        ('expired', found.expired),
        ('resumed', found.resumed),
        ('seconds', round(time.monotonic() - begun_s)),
    ):
        print('{:26} {:>8}'.format(name, value))
    wrong += growth(samples, options.robots)
    for text in wrong:
        print('wrong: ' + text)
    return int(bool(wrong))


class Killed:
    """Draws what is killed, and counts it."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._chance = random.Random('fleet {}'.format(options.seed))
        self._early = options.kills // 10
        self.counts: Dict[str, int] = {}

    def draw(self) -> str:
        """Draw what is killed next."""
        kinds = ['server', 'console', 'interface', 'action', 'roscore']
        if sum(self.counts.values()) < self._early:
            kinds.append('all')
        kind = 'robot' if self._chance.random() < 0.5 else self._chance.choice(kinds)
        self.counts['killed: ' + kind] = self.counts.get('killed: ' + kind, 0) + 1
        return kind


def sample(fleet: 'KilledFleet') -> Dict[str, Dict[str, int]]:  # noqa: F821
    """Return what the programs that are watched take now."""
    return {name: fleet.programs[name].state() for name in WATCHED}


def growth(samples: List[Dict[str, Dict[str, int]]], robots: int) -> List[str]:
    """Print what the watched programs took at first and at last; return what has grown."""
    more = MORE_A_ROBOT * robots
    tenth = max(1, len(samples) // 10)
    wrong = []
    for name in WATCHED:
        for what in ('kB', 'threads', 'files'):
            first, last = (
                max(each[name][what] for each in some)
                for some in (samples[tenth : 2 * tenth] or samples, samples[-tenth:])
            )
            print('{:26} {:>8} {:>8}'.format('{}: {}'.format(name, what), first, last))
            if last > (first * MORE_MEMORY if what == 'kB' else first + more):
                wrong.append('{} has grown from {} to {} {}'.format(name, first, last, what))
    return wrong


def open_questions(env: Dict[str, str]) -> str:
    """Return what the server's list says."""
    from killed_fleet import SERVER

    done = subprocess.run(
        [sys.executable, '-c', LEFT.format(SERVER)],
        env=env,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    lines = done.stdout.decode('utf-8', 'replace').strip().splitlines()
    return lines[-1] if lines else ''


if __name__ == '__main__':
    sys.exit(main())
