#!/usr/bin/env python3
"""Random trees, executed under an oracle and by a model of the rules: where do the two disagree?

    python3 benchmarks/random_trees.py [--trees N] [--seed S] [--only SEED] [--upstream PATH]
    [--check]

The model is written apart from the executive (test/unit/support/tree_model). The trees are up to
four levels deep, of StateMachines, Sequences, Concurrences and Iterators, with failures, preempts,
limits and answers at random. Each is executed twice. Events, visits, questions, outcomes and
userdata are compared step by step. Each is then preempted from another thread, at any moment. What
disagrees is shown with its seed, and runs again alone by --only. --upstream takes the smach found
at PATH. With --check the exit status is 1 where anything disagrees, hangs, or leaves a thread
behind.
"""

import argparse
import collections
import sys
import threading
from pathlib import Path
from typing import Any, Counter, List

from quiet import silence

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / 'test' / 'unit' / 'support'))

MOST_SHOWN = 5
# the second with --check, which are always the same. Unit tests have the seeds 0 to 199
TREES, CHECKED = 500, 200


def main() -> int:
    """Run and report."""
    arguments = parse_arguments()
    if arguments.upstream:
        sys.path.insert(0, arguments.upstream)
    import smach

    is_upstream = Path(smach.__file__).resolve().parents[1] != HERE.parent / 'src'
    print('engine: {}'.format(smach.__file__))
    silence()
    threading.excepthook = lambda said: None  # of the branches of Concurrences
    seeds: List[Any] = (
        [arguments.only]
        if arguments.only
        else [arguments.seed + number for number in range(arguments.trees)]
    )
    counts: Counter[str] = collections.Counter()
    for seed in seeds:
        try_tree(seed, is_upstream, counts)
    for name in (
        'trees',
        'decisions',
        'questions',
        'jumps across containers',
        'disagreements',
        'hangs',
        'threads left',
        'preempts that went wrong',
    ):
        print('{:26} {:>8}'.format(name, counts[name]))
    faults = sum(
        counts[name]
        for name in ('disagreements', 'hangs', 'threads left', 'preempts that went wrong')
    )
    return 1 if arguments.check and faults else 0


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument(
        '--trees', type=int, help='(default: {}, with --check {})'.format(TREES, CHECKED)
    )
    parser.add_argument(
        '--seed', type=int, default=200, help='of the first tree (default: %(default)s)'
    )
    parser.add_argument('--only', metavar='SEED', help='try the tree of this seed alone')
    parser.add_argument('--upstream', metavar='PATH', help='folder with an upstream smach')
    parser.add_argument('--check', action='store_true', help='fail where anything is wrong')
    given = parser.parse_args()
    if given.trees is None:
        given.trees = CHECKED if given.check else TREES
    return given


def try_tree(seed: Any, is_upstream: bool, counts: Counter[str]) -> None:
    """Execute one tree both ways, and preempt it; count what happens, show what is wrong."""
    from tree_model.comparing import compare
    from tree_model.disturbing import disturb
    from tree_model.drawing import ANY, UPSTREAM, draw

    shape = UPSTREAM if is_upstream else ANY
    found = compare(draw(seed, shape), is_upstream)
    kinds = collections.Counter(event[0] for _, event in found.executed.course)
    counts.update(
        {
            'trees': 1,
            'decisions': kinds['DECISION'],
            'questions': kinds['QUERY_OPENED'],
            'jumps across containers': found.model.cross_jumps,
            'hangs': int(found.is_hung),
            'threads left': len(found.threads_left),
            'disagreements': int(not found.is_fine),
        }
    )
    if not found.is_fine and counts['disagreements'] <= MOST_SHOWN:
        print(found.report())
    for wrong in disturb(draw(seed)):
        counts['preempts that went wrong'] += 1
        print(wrong)


if __name__ == '__main__':
    sys.exit(main())
