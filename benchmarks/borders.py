#!/usr/bin/env python3
"""Data drawn at random come in over every border: are they all taken, or refused with a reason?

    python3 benchmarks/borders.py [--examples N] [--only WORDS] [--check]

The examples are shared among the borders that the unit tests try with 200 each
(test/unit/support/borders): settings, parameters, messages, the console's socket, bags, rates,
stores, answers, a machine that runs, the robot's health, its skills, its interfaces, its world.
What comes past a border, or hangs for a minute, is shown with the smallest example that Hypothesis
finds. With --check there are fewer examples, and the exit status is 1 where there is any.
"""

import argparse
import logging
import sys
import time
import traceback
from pathlib import Path

from quiet import silence

HERE = Path(__file__).resolve().parent
for folder in ('test/unit/support', 'test/rostest'):
    sys.path.insert(0, str(HERE.parent / folder))

# with --check: a few random ones each, beside the 200 of the unit tests, which are always the same
TRIED, CHECKED = 100000, 1200


def main() -> int:
    """Run and report."""
    arguments = parse_arguments()
    silence()
    logging.disable(logging.CRITICAL)
    from borders.border import try_border
    from borders.table import BORDERS

    chosen = [border for name, border in sorted(BORDERS.items()) if arguments.only in name]
    examples = arguments.examples or (CHECKED if arguments.check else TRIED)
    each = -(-examples // max(1, len(chosen)))
    faults = 0
    print('{:42} {:>8} {:>8} {:>8}'.format('border', 'taken', 'refused', 's'))
    for border in chosen:
        began_s = time.monotonic()
        try:
            ends = try_border(border, each, is_random=True)
        except BaseException as err:
            if isinstance(err, KeyboardInterrupt):
                raise
            faults += 1
            print('{:42} FAULT'.format(border.name))
            traceback.print_exc()
            continue
        print(
            '{:42} {:8} {:8} {:8.1f}'.format(
                border.name, ends['taken'], ends['refused'], time.monotonic() - began_s
            ),
            flush=True,
        )
    print('{} borders, {} examples each, {} faults'.format(len(chosen), each, faults))
    return 1 if arguments.check and faults else 0


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument(
        '--examples',
        type=int,
        default=0,
        help='of all borders together (default: {}, with --check {})'.format(TRIED, CHECKED),
    )
    parser.add_argument('--only', default='', metavar='WORDS', help='borders with these words')
    parser.add_argument('--check', action='store_true', help='fail where anything is wrong')
    return parser.parse_args()


if __name__ == '__main__':
    sys.exit(main())
