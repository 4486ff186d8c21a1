#!/usr/bin/env python3
"""The speed of the simulated PR2, and what its time goes into: a few trials of a task on a master
of their own.

    benchmarks/pr2_world.py [--task drink_retrieval] [--trials N] [--oracle] [--check]

Prints the real-time factor (simulated s per wall s), the world's share of the time by what it did,
and each state's, the robot's planning and perception included. --check fails where simulated time
does not run faster than the wall's. It runs three trials: their factor is far from the limit.
"""

import argparse
import collections
import contextlib
import io
import os
import sys
import tempfile
from typing import Dict, List, Sequence

from smach_oracle.analysis.bag_events import EventReader, find_bags
from smach_oracle.analysis.trials import TrialSummary, load_trials
from smach_oracle.experiment.command import main as run_trials
from smach_oracle.oracle.records.events import Event, EventKind

LEAST_FACTOR = 1.0
TRIALS, CHECKED = 5, 3  # the second with --check
# the world: while a subsystem plans or looks, or nothing is commanded
WAITING = 'waiting for others'


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--task', default='pick_and_place', help='(default: %(default)s)')
    parser.add_argument(
        '--trials', type=int, help='(default: {}, with --check {})'.format(TRIALS, CHECKED)
    )
    parser.add_argument(
        '--seed', type=int, default=1, help='of the first trial (default: %(default)s)'
    )
    parser.add_argument(
        '--oracle', action='store_true', help='recover, and ask the scripted expert'
    )
    parser.add_argument(
        '--check', action='store_true', help='fail where it is slower than real time'
    )
    args = parser.parse_args()
    if args.trials is None:
        args.trials = CHECKED if args.check else TRIALS
    with tempfile.TemporaryDirectory() as folder:
        words = [
            '--task',
            args.task,
            '--trials',
            str(args.trials),
            '--seed',
            str(args.seed),
            '--jobs',
            '1',
            '--output',
            folder + '/trials',
            '--variants',
            'with' if args.oracle else 'without',
        ]
        with contextlib.redirect_stdout(io.StringIO()) as told:
            code = run_trials(words)
        if code:
            sys.stderr.write(told.getvalue())
            return code
        factor = report(load_trials([folder]).trials, states_of(folder))
    if args.check and factor < LEAST_FACTOR:
        print(
            'slower than real time: {:.2f}, at least {:.1f} is wanted'.format(factor, LEAST_FACTOR)
        )
        return 1
    return 0


def states_of(folder: str) -> Dict[str, float]:
    """Wall s spent in each state, by its label; in questions to the expert as "(expert)"."""
    spent: Dict[str, float] = collections.defaultdict(float)
    reader = EventReader()
    for path in find_bags([folder]):
        add_states(reader.read(path).events, spent)
    return spent


def add_states(events: Sequence[Event], spent: Dict[str, float]) -> None:
    """Add what one trial spent in each state."""
    entered: Dict[str, float] = {}
    for event in sorted(events, key=lambda each: each.seq):
        if event.kind in (EventKind.STATE_START, EventKind.QUERY_OPENED):
            entered[event.state] = event.wall_time
        elif event.kind in (EventKind.TRANSITION, EventKind.FAILURE) and event.state in entered:
            spent[event.state] += event.wall_time - entered.pop(event.state)
        elif (
            event.kind in (EventKind.JUMP, EventKind.SUPERSEDE, EventKind.GIVE_UP)
            and event.state in entered
        ):
            spent['(expert)'] += event.wall_time - entered.pop(event.state)


def report(trials: List[TrialSummary], states: Dict[str, float]) -> float:
    """Print it all; returns the real-time factor."""
    truths = [trial.truth for trial in trials if trial.truth is not None]
    wall_s, sim_s = sum(truth.wall_s for truth in truths), sum(truth.sim_s for truth in truths)
    print(
        '{} trials on {} cores: {:.1f} s a trial, {:.1f} s of simulated time; real-time factor '
        '{:.2f}'.format(
            len(truths), os.cpu_count(), wall_s / len(truths), sim_s / len(truths), sim_s / wall_s
        )
    )
    world: Dict[str, float] = collections.defaultdict(float)
    for truth in truths:
        for name, share in truth.share.items():
            world[WAITING if name == 'idle' else name] += share * truth.wall_s
    world['the rest'] = max(0.0, wall_s - sum(world.values()))
    print_shares('the world', world, wall_s)
    print_shares('states of the task', states, sum(trial.duration_s for trial in trials))
    return sim_s / wall_s


def print_shares(title: str, spent: Dict[str, float], whole_s: float) -> None:
    """Shares of the time, largest first."""
    print('\n{:<28}{:>9}'.format(title, 'share'))
    for name, seconds in sorted(spent.items(), key=lambda item: -item[1]):
        print('  {:<26}{:>8.1f}%'.format(name, 100 * seconds / whole_s))


if __name__ == '__main__':
    sys.exit(main())
