#!/usr/bin/env python3
"""Weighted streaks against what is measured: how often do the intervals hold it?

    python3 benchmarks/what_if_cover.py [--machines N] [--trials N] [--seed S] [--recorded NAME]
    [--asked NAME ...] [--jobs N]

Each machine of the generator (test/unit/support/hidden_causes, doc/inside/hidden_causes.md) runs
under a policy whose choices are drawn, such as escalating:explore=0.3 or any_way. The command puts
the record to another policy. The same machine then runs under that one, in the same trials. A
figure is covered if what is measured lies within its 95% interval. Exit code: 0 if each figure is
covered in 90% of the machines with enough data, else 1. Seeds below 1000 are for trying.
"""

import argparse
import concurrent.futures
import multiprocessing
import sys
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Tuple

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / 'test' / 'unit' / 'support'))

from hidden_causes.causes import draw_causes
from hidden_causes.drawing import draw
from hidden_causes.many import be_quiet
from hidden_causes.mix import MIX
from hidden_causes.orders import Arm
from hidden_causes.running import Bed

from smach_oracle.analysis import what_if
from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.replaying.weighting import FIGURES, Findings
from smach_oracle.oracle.records.events import Event, EventKind

LEAST = 0.9


class Machine(NamedTuple):
    """What one machine has shown."""

    seed: int
    why_not: str  # there is no estimate
    measured: Dict[str, float]
    intervals: Dict[str, Tuple[float, float]]


def record(seed: int, name: str, trials: int) -> List[List[Event]]:
    """Run a machine, and return the events of each trial, in the time of its world."""
    arm, box = Arm(name), draw(seed)
    policy = arm.policy(seed)
    if policy is None:
        raise ValueError('{}: no oracle decides'.format(name))
    named: Dict[str, Any] = {'policy': policy.name}
    named.update({'policy.' + key: getattr(policy, key) for key in policy.parameters})
    events: List[Event] = []
    with Bed(box, draw_causes(seed, box, MIX), policy, MIX) as bed:

        def observe(event: Event) -> None:
            if event.kind is EventKind.TRIAL_START and event.data is not None:
                settings = {**event.data['settings'], **named}
                event = event._replace(data={**event.data, 'settings': settings})
            events.append(event._replace(wall_time=bed.now_s()))

        bed.machine.events.observers.append(observe)
        for number in range(trials):
            bed.trial(number)
    found: Dict[str, List[Event]] = {}
    for event in events:
        found.setdefault(event.trial_id, []).append(event)
    return list(found.values())


def put_to(trials: List[List[Event]], asked: str) -> Findings:
    """Put a record to another policy."""
    name, _, parameters = asked.partition(':')
    settings: Dict[str, Any] = {'policy': name}
    for each in filter(None, parameters.split(',')):
        key, _, value = each.partition('=')
        settings['policy.' + key] = float(value)
    findings = what_if.compare(what_if.Recorded(trials), settings).streaks
    if findings is None:
        raise ValueError('{}: goes by no ways'.format(asked))
    return findings


def try_machine(work: Tuple[int, str, str, int]) -> Machine:
    """Estimate, and measure."""
    seed, recorded, asked, trials = work
    be_quiet()
    try:
        estimate = put_to(record(seed, recorded, trials), asked).estimate
        measured = put_to(record(seed, asked, trials), asked).bounds
    except BagError as err:
        return Machine(seed, str(err), {}, {})
    means = {figure: low for figure, (low, _) in measured.ranges.items()}
    if estimate is None or estimate.why_not:
        return Machine(seed, 'no draws' if estimate is None else estimate.why_not, means, {})
    return Machine(seed, '', means, estimate.intervals)


def main() -> int:
    """Run and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--machines', type=int, default=30, metavar='N')
    parser.add_argument('--trials', type=int, default=400, metavar='N')
    parser.add_argument('--seed', type=int, default=0, metavar='S')
    parser.add_argument('--recorded', default='escalating:explore=0.3', metavar='NAME')
    parser.add_argument('--asked', nargs='+', default=['escalating'], metavar='NAME')
    parser.add_argument('--jobs', type=int, default=1, metavar='N')
    arguments = parser.parse_args()
    seeds = range(arguments.seed, arguments.seed + arguments.machines)
    good = True
    for asked in arguments.asked:
        work = [(seed, arguments.recorded, asked, arguments.trials) for seed in seeds]
        context = multiprocessing.get_context('fork')
        with concurrent.futures.ProcessPoolExecutor(arguments.jobs, context) as pool:
            machines = list(pool.map(try_machine, work))
        enough = [each for each in machines if not each.why_not]
        print(
            '{} put to {}: enough data in {} of {} machines, {} trials each'.format(
                arguments.recorded, asked, len(enough), len(machines), arguments.trials
            )
        )
        for figure in FIGURES:
            held = [
                each.intervals[figure][0] - 1e-9
                <= each.measured[figure]
                <= each.intervals[figure][1] + 1e-9
                for each in enough
            ]
            widths = sorted(high - low for low, high in (each.intervals[figure] for each in enough))
            print(
                '  {:10} covered in {} of {}, median width {:.2f}'.format(
                    figure, sum(held), len(held), widths[len(widths) // 2] if widths else 0.0
                ),
                flush=True,
            )
            good = good and sum(held) >= LEAST * len(held)
    return 0 if good else 1


if __name__ == '__main__':
    sys.exit(main())
