#!/usr/bin/env python3
"""A robot under oracle_run --checkpoint --resume=recover, while what it needs is killed: what must
hold, holds it?

    python3 benchmarks/killed_nodes.py [--what KIND ...] [--kills N] [--seed S]

Each KIND (server, console, interface, action, roscore, robot, all) has programs of its own, on a
master of its own. They are killed by SIGKILL at random instants, and come up again at once. The
robot goes round: a goal of an action server, a failure that an expert is asked about, a line in a
journal. Each round is told, in turn, once, or again where the program was killed in it. Each
question is closed once. In the end every robot has come to its end. Otherwise the exit status is 1.
"""

import argparse
import signal
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'rostest'))

LONGEST_S = 1.5  # of a round and a bit
SHOWN = '{:>10} {:>6} {:>7} {:>10} {:>9} {:>8} {:>8} {:>6} {:>8}'


def main() -> int:
    from killed_fleet import KINDS

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--what', nargs='+', choices=KINDS, default=KINDS, help='(default: each)')
    parser.add_argument('--kills', type=int, default=50, help='of each (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='(default: %(default)s)')
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no program is left
    print(
        SHOWN.format(
            'what',
            'kills',
            'rounds',
            'questions',
            'answered',
            'expired',
            'resumed',
            'wrong',
            'seconds',
        ),
        flush=True,
    )
    return int(any([kill_one_kind(kind, options) for kind in options.what]))


def kill_one_kind(kind: str, options: argparse.Namespace) -> bool:
    """Kill programs of a kind, and print the row; return whether anything is wrong."""
    from killed_fleet import KilledFleet

    begun_s = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        fleet = KilledFleet(folder, robots=1)
        fleet.start()
        try:
            fleet.run_under_kills(lambda: kind, options.kills, options.seed, LONGEST_S)
            found = fleet.judge()
        finally:
            fleet.stop()
    print(
        SHOWN.format(
            kind,
            options.kills,
            found.rounds,
            found.questions,
            found.answered,
            found.expired,
            found.resumed,
            len(found.wrong),
            round(time.monotonic() - begun_s),
        ),
        flush=True,
    )
    for text in found.wrong[:5]:
        print('  ' + text)
    return bool(found.wrong)


if __name__ == '__main__':
    sys.exit(main())
