#!/usr/bin/env python3
"""Freeze the seeds of the experiment, or abandon the last freeze. Nothing is run.

The seeds follow from doc/protocol.md and from the code as committed: that page says how. A line of
doc/freezes.csv has them, with the note.
"""

import argparse
import sys

from smach_oracle.experiment.freeze import ABANDONED, FROZEN, checkout, run_freeze
from smach_oracle.experiment.plan import ExperimentError


def main() -> int:
    """Return the exit code: 0, or 1 where nothing can be frozen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--abandon', action='store_true', help='abandon the last freeze')
    parser.add_argument('note', metavar='NOTE', help='why')
    args = parser.parse_args()
    try:
        print(run_freeze(checkout(), ABANDONED if args.abandon else FROZEN, args.note))
    except (ExperimentError, OSError) as err:
        print(err, file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
