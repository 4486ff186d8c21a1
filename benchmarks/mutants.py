#!/usr/bin/env python3
"""Mutants of the executive: small faults put in at random. Which of them does no test see?

    python3 benchmarks/mutants.py [--mutants N] [--seed S] [--jobs N] [--only NAME ...]
    [--report FILE]

Each mutant is one change of one expression or statement in src/smach_oracle/oracle, such as `<`
made `<=`, a condition turned around, or a call left out. A mutant is killed if a test in
test/unit/oracle fails twice, or does not end. Only the tests that reach its statement run, the
likeliest to see it first. The mutants that survive are shown, each with its name, which --only
takes. Those in mutants_equivalent.csv change nothing that anybody sees, for the reason given there,
and are not counted. The exit status is 1 where fewer than 95% of the others are killed.

It takes seconds to minutes for each mutant, so it is a command for a weekly job. It changes copies
of the tree alone, and needs Debian's python3-coverage.
"""

import argparse
import collections
import contextlib
import csv
import itertools
import os
import random
import signal
import sys
import tempfile
from pathlib import Path
from typing import Dict, List, NamedTuple, Sequence, Set

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / 'test/unit/support'), str(ROOT / 'test/harness')]

from mutating.collected import TestsNotRun
from mutating.mutations import Mutant
from mutating.trying import Project, Reach, Trial, Workshop

EQUIVALENT = Path(__file__).with_name('mutants_equivalent.csv')
LEAST_KILLED = 0.95
EXECUTIVE = Project(ROOT, 'src/smach_oracle/oracle', 'test/unit/oracle')


class Change(NamedTuple):
    """A mutant, whatever the number of its line is now."""

    module: str
    place: str
    code: str  # the line on which it begins
    before: str
    after: str


def main() -> int:
    """Make the mutants, try each, and report."""
    arguments = parse_arguments()
    try:
        import coverage
    except ImportError:
        sys.exit('python3-coverage is not installed: run scripts/setup --dev')
    print('coverage {}'.format(coverage.__version__))
    # SIGINT too: a shell that starts this in the background has it ignored
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    mutants, is_whole = choose(arguments), False
    trials: List[Trial] = []
    try:
        with tempfile.TemporaryDirectory(prefix='mutants.') as folder:
            workshop = Workshop(EXECUTIVE, Path(folder), arguments.jobs)
            print('each test runs once, to see which lines it reaches', flush=True)
            reaches = list(itertools.chain.from_iterable(workshop.look()))
            try_all(workshop, mutants, reaches, trials)
            is_whole = True
    except (TestsNotRun, KeyboardInterrupt) as error:
        print(str(error) or 'interrupted')
        print('{} mutants were not tried'.format(len(mutants) - len(trials)))
    if arguments.report:
        write_report(trials, arguments.report)
    status = summarise(trials)
    return status if is_whole else 130


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--mutants', type=int, default=200, help='(default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0, help='of the choice (default: %(default)s)')
    parser.add_argument(
        '--jobs',
        type=int,
        default=os.cpu_count() or 1,
        help='mutants at a time (default: %(default)s)',
    )
    parser.add_argument(
        '--only',
        metavar='NAME',
        nargs='+',
        default=[],
        help='try these alone, such as machine/repeats.py:52:9:0',
    )
    parser.add_argument('--report', metavar='FILE', help='write each mutant to this CSV file, too')
    return parser.parse_args()


def choose(arguments: argparse.Namespace) -> List[Mutant]:
    """Return the mutants that are wanted: those named, or as many as wanted of all, at random."""
    every = EXECUTIVE.mutants()
    if arguments.only:
        named = {mutant.name: mutant for mutant in every}
        missing = [name for name in arguments.only if name not in named]
        if missing:
            sys.exit('no such mutant: {}'.format(', '.join(missing)))
        return [named[name] for name in arguments.only]
    random.Random(arguments.seed).shuffle(every)
    wanted = every[: arguments.mutants]
    print(
        '{} of {} mutants of {}, seed {}'.format(
            len(wanted), len(every), EXECUTIVE.mutated, arguments.seed
        ),
        flush=True,
    )
    return wanted


def try_all(
    workshop: Workshop, mutants: Sequence[Mutant], reaches: List[Reach], trials: List[Trial]
) -> None:
    """Try each mutant, show what became of it, and add that to the trials."""
    known = equivalents()
    with contextlib.closing(workshop.try_all(mutants, reaches)) as found:
        for trial in found:
            trials.append(trial)
            is_known = change_of(trial.mutant) in known
            show(trial, '{}/{}'.format(len(trials), len(mutants)), is_known)


def show(trial: Trial, number: str, is_known: bool) -> None:
    """Say what became of a mutant. `is_known`: it is listed as equivalent."""
    print(
        '{:>8}  {:10} {:6.1f} s  {:40} {}'.format(
            number,
            'equivalent' if is_known else trial.verdict,
            trial.took_s,
            trial.mutant.name,
            trial.by,
        ),
        flush=True,
    )
    if is_known and not trial.is_alive:
        print('    it is listed as equivalent, and a test sees it', flush=True)
    if trial.is_alive and not is_known:
        print(trial.mutant.shown(), flush=True)


def change_of(mutant: Mutant) -> Change:
    """Return the change that a mutant is."""
    return Change(mutant.module, mutant.place, mutant.code, mutant.before, mutant.after)


def equivalents() -> Set[Change]:
    """Return the changes that nobody can see."""
    with EQUIVALENT.open(newline='', encoding='utf-8') as file:
        return {Change(*(row[field] for field in Change._fields)) for row in csv.DictReader(file)}


def write_report(trials: Sequence[Trial], path: str) -> None:
    """Write what became of each mutant."""
    with open(path, 'w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(('name', 'verdict', 'by', 'tests', 'seconds') + Change._fields)
        for trial in trials:
            writer.writerow(
                (
                    trial.mutant.name,
                    trial.verdict,
                    trial.by,
                    trial.tests,
                    '{:.1f}'.format(trial.took_s),
                )
                + change_of(trial.mutant)
            )


def summarise(trials: Sequence[Trial]) -> int:
    """Show the counts by package. Return 1 where too few were killed."""
    known = equivalents()
    columns = ('mutants', 'killed', 'hung', 'equivalent', 'survived', 'unreached')
    rows: Dict[str, Dict[str, int]] = collections.defaultdict(collections.Counter)
    for trial in trials:
        same = trial.is_alive and change_of(trial.mutant) in known
        for name in (str(Path(trial.mutant.module).parent), 'all'):
            rows[name]['mutants'] += 1
            rows[name]['equivalent' if same else trial.verdict] += 1
    print('\n{:12}'.format('') + ''.join(map('{:>11}'.format, columns)))
    for name in sorted(rows, key=lambda name: (name == 'all', name)):
        print('{:12}'.format(name) + ''.join('{:>11}'.format(rows[name][each]) for each in columns))
    counted = rows['all']['mutants'] - rows['all']['equivalent']
    killed = rows['all']['killed'] + rows['all']['hung']
    share = killed / counted if counted else 1.0
    print(
        '\nkilled: {} of {}, {:.1%} (at least {:.0%})'.format(killed, counted, share, LEAST_KILLED)
    )
    return int(share < LEAST_KILLED)


if __name__ == '__main__':
    sys.exit(main())
