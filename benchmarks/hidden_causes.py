#!/usr/bin/env python3
"""Policies on machines whose failures have hidden causes: what does each of them cost?

    python3 benchmarks/hidden_causes.py [--machines N] [--trials N] [--seed S] [--policy NAME ...]
    [--jobs N] [--best N] [--report FILE]

The machines are drawn with the statistics of public SMACH programs, and their failures follow from
a small world of conditions (test/unit/support/hidden_causes, doc/inside/hidden_causes.md). Each is
a plain script under `OracleContainer.wrap`, with a policy and no other setting, executed by the
real executive in simulated time. The policies are those of the executive by name, such as ladder or
ladder:wait_s=30. Beside them are bare (no oracle), order:WAY,... (retry, wait, step_back, restart,
ask, give_up), shuffled (the same ways in an order that is drawn for each trial), shuffled_labels
(learned, from results that have changed places), and best: the
order that costs least on other machines of the same mix, those of --best-seed. The same seeds give
the same figures, whatever --jobs. Seeds below 1000 are for trying. Those from 1000 on are kept for
judging policies that are settled.
"""

import argparse
import csv
import os
import sys
import time
from pathlib import Path
from typing import Dict, List, Sequence

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / 'test' / 'unit' / 'support'))

from hidden_causes.costs import Prices, Summary, difference, summarise
from hidden_causes.many import Ran, Runner
from hidden_causes.orders import Arm
from hidden_causes.running import Trial
from hidden_causes.search import best_order

BEST = 'best'
POLICIES = (
    'bare', 'retry', 'step_back', 'restart', 'ladder', 'prose', 'algorithm1', 'random',
    'always_ask', 'shuffled', 'escalating', 'any_way', 'learned', 'shuffled_labels',
)  # fmt: skip
ORDER_OF = 'escalating'
LEARNS = ('learned', 'shuffled_labels')  # each changes that order
FOR_JUDGING = 1000  # seeds from here on
COLUMNS = (
    ('failing', 'failing', '{:.1%}'),
    ('true', 'true_success', '{:.1%}'),
    ('false', 'false_success', '{:.1%}'),
    ('lost', 'lost', '{:.1%}'),
    ('person', 'person', '{:.1%}'),
    ('questions', 'questions', '{:.3f}'),
    ('attempts', 'attempts', '{:.3f}'),
    ('robot min', 'robot_min', '{:.2f}'),
    ('expert min', 'expert_min', '{:.2f}'),
    ('harm', 'harm', '{:.3f}'),
    ('cost', 'cost', '{:.2f}'),
    ('error', 'error', '{:.2f}'),
)


def main() -> int:
    """Run and report."""
    arguments = parse_arguments()
    prices = prices_of(arguments)
    seeds = range(arguments.seed, arguments.seed + arguments.machines)
    found: Dict[str, List[Ran]] = {}
    print(
        '{} machines, seeds {} to {} ({}), {} trials each, {} jobs'.format(
            arguments.machines,
            seeds[0],
            seeds[-1],
            'for judging' if seeds[-1] >= FOR_JUDGING else 'for trying',
            arguments.trials,
            arguments.jobs,
        )
    )
    print('{:26}'.format('') + ''.join('{:>11}'.format(name) for name, _, _ in COLUMNS), flush=True)
    with Runner(arguments.jobs) as runner:
        for name in arguments.policy:
            if name == BEST:
                name = search(runner, arguments, prices)
            began_s = time.monotonic()
            found[name] = runner.run(name, seeds, arguments.trials, {'cost': prices._asdict()})
            show(name, summarise(trials_of(found[name]), prices), found[name], began_s)
    show_differences(found, prices)
    show_more_attempts(found)
    show_other_prices(found, prices)
    if arguments.report:
        write_report(found, prices, arguments.report)
    return 0


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--machines', type=int, default=100, help='(default: %(default)s)')
    parser.add_argument(
        '--trials', type=int, default=200, help='of each machine (default: %(default)s)'
    )
    parser.add_argument(
        '--seed', type=int, default=0, help='of the first machine (default: %(default)s)'
    )
    parser.add_argument(
        '--policy',
        metavar='NAME',
        nargs='+',
        default=[*POLICIES, BEST],
        help='(default: {} and {})'.format(', '.join(POLICIES), BEST),
    )
    parser.add_argument(
        '--jobs',
        type=int,
        default=os.cpu_count() or 1,
        help='machines at a time (default: %(default)s)',
    )
    parser.add_argument(
        '--best', metavar='N', type=int, default=30, help='machines for best (default: %(default)s)'
    )
    parser.add_argument(
        '--best-seed', type=int, default=900, help='of the first of these (default: %(default)s)'
    )
    parser.add_argument(
        '--best-trials', type=int, default=30, help='of each of these (default: %(default)s)'
    )
    for name, price in Prices()._asdict().items():
        parser.add_argument(
            '--' + name.replace('_', '-'),
            type=float,
            default=price,
            help='its price in robot minutes (default: %(default)s)',
        )
    parser.add_argument('--report', metavar='FILE', help='write each machine to this CSV file')
    arguments = parser.parse_args()
    if min(arguments.machines, arguments.trials, arguments.jobs) < 1 or arguments.seed < 0:
        parser.error('--machines, --trials and --jobs are at least 1, and --seed at least 0')
    for name in arguments.policy:
        if name != BEST:
            try:
                Arm(name)
            except ValueError as error:
                parser.error(str(error))
    last = arguments.seed + arguments.machines - 1
    if BEST in arguments.policy and not (
        last < arguments.best_seed or arguments.best_seed + arguments.best <= arguments.seed
    ):
        parser.error(
            'best is sought on other machines: seeds {} to {} overlap those of --best-seed'.format(
                arguments.seed, last
            )
        )
    return arguments


def prices_of(arguments: argparse.Namespace) -> Prices:
    """The prices of the command line."""
    return Prices(*(getattr(arguments, name) for name in Prices._fields))


def trials_of(machines: Sequence[Ran]) -> List[Sequence[Trial]]:
    """The trials, machine by machine."""
    return [machine.trials for machine in machines]


def search(runner: Runner, arguments: argparse.Namespace, prices: Prices) -> str:
    """Return the best order, as a policy of the command line."""
    seeds = range(arguments.best_seed, arguments.best_seed + arguments.best)

    def cost(order: Sequence[str]) -> float:
        ran = runner.run('order:' + ','.join(order), seeds, arguments.best_trials)
        return summarise(trials_of(ran), prices).cost

    found = best_order(cost)
    print(
        'best of {} orders, on seeds {} to {} with {} trials: {}'.format(
            found.tried, seeds[0], seeds[-1], arguments.best_trials, ', '.join(found.order)
        ),
        flush=True,
    )
    return 'order:' + ','.join(found.order)


def show(name: str, summary: Summary, machines: Sequence[Ran], began_s: float) -> None:
    """Show the row of a policy."""
    cells = [form.format(getattr(summary, field)) for _, field, form in COLUMNS]
    print(
        '{:26}'.format(name)
        + ''.join('{:>11}'.format(cell) for cell in cells)
        + '   {:.0f} s, {:.0f} s of CPU'.format(
            time.monotonic() - began_s, sum(machine.cpu_s for machine in machines)
        ),
        flush=True,
    )


def show_differences(found: Dict[str, List[Ran]], prices: Prices) -> None:
    """Show how much dearer each policy is than the first, machine by machine."""
    first = next(iter(found))
    print('\ndearer than {} by, in a trial (standard error over machines):'.format(first))
    for name, machines in found.items():
        if name != first:
            more, error = difference(trials_of(machines), trials_of(found[first]), prices)
            print('{:26}{:>11.2f}{:>11.2f}'.format(name, more, error))


def show_more_attempts(found: Dict[str, List[Ran]]) -> None:
    """Show on how many machines a policy that learns had more than one attempt a streak more.

    More, that is, than the policy whose order it changes.
    """
    if ORDER_OF not in found:
        return
    for name in filter(LEARNS.__contains__, found):
        more = [
            ran.seed
            for ran, usual in zip(found[name], found[ORDER_OF])
            if sum(each.attempts for each in ran.trials)
            > sum(each.attempts + each.streaks for each in usual.trials)
        ]
        told = ', '.join(map(str, more)) or 'none'
        print(
            '\n{}: machines with more than one attempt a streak more than {}: {}'.format(
                name, ORDER_OF, told
            )
        )


def show_other_prices(found: Dict[str, List[Ran]], prices: Prices) -> None:
    """Show what a trial costs by other prices, and which policy is the cheapest then."""
    changed = prices.changed()
    print('\ncost of a trial, with each price halved and doubled:')
    print('{:26}'.format('') + ''.join('{:>13}'.format(name[:12]) for name in found))
    for words, other in changed.items():
        costs = {
            name: summarise(trials_of(machines), other).cost for name, machines in found.items()
        }
        print(
            '{:26}'.format(words)
            + ''.join('{:>13.2f}'.format(cost) for cost in costs.values())
            + '   '
            + min(costs, key=lambda name: costs[name])
        )


def write_report(found: Dict[str, List[Ran]], prices: Prices, path: str) -> None:
    """Write a row for each machine under each policy."""
    fields = [field for field in Summary._fields if field != 'error']
    with open(path, 'w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(['policy', 'seed', *fields, 'cpu_s'])
        for name, machines in found.items():
            for machine in machines:
                summary = summarise([machine.trials], prices)
                writer.writerow(
                    [name, machine.seed]
                    + [getattr(summary, field) for field in fields]
                    + ['{:.2f}'.format(machine.cpu_s)]
                )


if __name__ == '__main__':
    sys.exit(main())
