#!/usr/bin/env python3
"""The effect of each kind of cause on a script without an oracle, and how long it lasts.

    benchmarks/cause_persistence.py [--task TASK] [--kind KIND ...] [--trials N] [--csv FILE]

For each kind of cause, N scenes that have it alone are run in one process without ROS. The state
that fails is tried again up to three times, then the script is started over up to twice. Printed
are the trials that failed, those that a retry or a restart cured, and those in which the cause was
still there when the state was tried again, by the world's own log. Seeds are below 1000.
"""

import argparse
import csv
import pathlib
from typing import List

from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.drink_retrieval import DrinkRetrievalRehearsal
from smach_oracle.simulation.rehearsal.persistence import (
    RehearsedTrial,
    label,
    run_scene,
    scenes_of,
)
from smach_oracle.simulation.rehearsal.pick_and_place import PickAndPlaceRehearsal
from smach_oracle.simulation.scenes import kitchen_causes, tabletop_causes
from smach_oracle.simulation.scenes.tasks import TASKS, draw

REHEARSALS = dict(zip(TASKS, (PickAndPlaceRehearsal, DrinkRetrievalRehearsal)))
KINDS = dict(zip(TASKS, (tabletop_causes.KINDS, kitchen_causes.KINDS)))
SEEDS = range(1000)
HEAD = '{:18} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>9} {:>9}  {}'


def report(kind: str, courses: List[RehearsedTrial]) -> None:
    """Print a row about one kind."""
    ended = [each.ended for each in courses]
    failed = [each for each in courses if each.failed]
    restarted = [each for each in failed if each.cured_by != 'retry']
    print(
        HEAD.format(
            kind,
            len(courses),
            len(failed),
            ended.count('retry'),
            ended.count('restart'),
            ended.count('failed'),
            ended.count('false success'),
            '{}/{}'.format(sum(each.there_at_retry for each in failed), len(failed)),
            '{}/{}'.format(sum(each.there_at_restart for each in restarted), len(restarted)),
            label(courses),
        ),
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--task', choices=TASKS, default=TASKS[0])
    parser.add_argument('--kind', nargs='*', help='these kinds alone')
    parser.add_argument(
        '--trials', type=int, default=10, help='for each kind (default: %(default)s)'
    )
    parser.add_argument('--csv', type=pathlib.Path, help='a file that gets a row for each trial')
    args = parser.parse_args()
    print(
        HEAD.format(
            'cause',
            'trials',
            'failed',
            'retry',
            'restart',
            'never',
            'false',
            'at retry',
            'restarted',
            'label',
        )
    )
    world, rows = World(binning=2), []
    for kind in args.kind or KINDS[args.task]:
        scenes = scenes_of(lambda seed: draw(args.task, seed, False), kind, args.trials, SEEDS)
        courses = [run_scene(scene, world, REHEARSALS[args.task]) for scene in scenes]
        report(kind, courses)
        rows += courses
    world.close()
    if args.csv:
        with open(args.csv, 'w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file)
            writer.writerow(RehearsedTrial._fields + ('ended',))
            writer.writerows([*each, each.ended] for each in rows)


if __name__ == '__main__':
    main()
