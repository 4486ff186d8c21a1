"""Count what happened in recorded trials: the paper's Table I, its time series, their data.

Exit code: 0, all bags were read; 1, some were skipped; 2, there was nothing to count or an output
cannot be written.
"""

import argparse
import contextlib
import os
import re
import sys
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

from smach_oracle.cluster import ClusterError, WorkerCluster, add_options
from smach_oracle.oracle.records.short_text import seen
from smach_oracle.oracle.settings.failure_rule import FailureRule
from smach_oracle.oracle.settings.paths import path_of

from . import table
from .bag_events import BagError
from .comparing.groups import BY, TrialGroup, groups_by
from .counting.trial_summary import TrialSummary
from .reading import report_error, report_skipped, rule_of
from .trials import Trials, load_by_state, load_trials
from .variants import VariantCounts, count_variants, time_series

# What an option alone needs is imported where that is there: to import it takes longer than to
# count a hundred bags.
if TYPE_CHECKING:
    from .by_state.rows import VariantStates
    from .by_state.state_counts import StatesOfTrials

# the trials, and what happened in the states of each
_Loaded = Tuple[Trials, Optional[Mapping[str, 'StatesOfTrials']]]


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command, and return its exit code."""
    args = _parse(argv)
    try:
        rule = rule_of('bag_statistics', args.failing_outcomes)
        with contextlib.ExitStack() as closing:
            cluster = (
                closing.enter_context(WorkerCluster(args.scheduler, args.without_tls))
                if args.scheduler
                else None
            )
            found, by_trial = _load(args, rule, cluster)
            for text in cluster.messages if cluster else ():
                sys.stderr.write('bag_statistics: {}\n'.format(text))
        variants = count_variants(found.trials)
        sys.stdout.write(seen(table.format_text(variants, found.trials)))
        states = None if by_trial is None else _print_states(found, by_trial)
        groups = _print_groups(args, found) if args.by else None
        code = report_skipped(found.skipped)
        _write_files(args, found, variants, states, groups)
        if args.html:
            _write_report(args, rule, found, groups)
    except ClusterError as err:
        return report_error('bag_statistics', err)
    except (BagError, ImportError, OSError) as err:
        from .compare_command.inputs import instead_of_bags

        return report_error('bag_statistics', instead_of_bags(err, args.folders))
    return code


def _print_states(found: Trials, by_trial: Mapping[str, 'StatesOfTrials']) -> List['VariantStates']:
    from .by_state.rows import by_variant
    from .by_state.text import format_states

    states = by_variant(found.trials, by_trial)
    sys.stdout.write(seen(format_states(states)))
    return states


def _print_groups(args: argparse.Namespace, found: Trials) -> List[TrialGroup]:
    from .comparing.report import format_groups

    groups = groups_by(args.by, found.trials, args.folders)
    sys.stdout.write(seen(format_groups(args.by, groups)))
    return groups


def _load(
    args: argparse.Namespace, rule: Optional[FailureRule], cluster: Optional[WorkerCluster]
) -> _Loaded:
    if args.by_state:
        return load_by_state(args.folders, rule, _processes(), cluster)
    return load_trials(args.folders, rule, _processes(), cluster), None


def _processes() -> int:
    """Return how many processes count: one for each core that this one may use."""
    return len(os.sched_getaffinity(0))


def _parse(argv: Optional[Sequence[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='bag_statistics',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        'folders',
        nargs='+',
        metavar='FOLDER',
        type=path_of,
        help='with bags in it or below it; or a bag',
    )
    parser.add_argument(
        '--figure',
        metavar='STEM',
        type=path_of,
        help='write the time series to STEM.svg and STEM.png',
    )
    parser.add_argument(
        '--columns',
        type=int,
        choices=(1, 2),
        default=1,
        help='width of the figure: one (3.5 in) or two (7.16 in) columns of a paper (default: 1)',
    )
    parser.add_argument(
        '--x-axis',
        choices=('trials', 'time'),
        default='trials',
        help='of the figure: number of the trial, or time since the first (default: trials)',
    )
    parser.add_argument(
        '--json',
        metavar='FILE',
        type=path_of,
        help='write the table, all trials and the skipped bags as JSON',
    )
    parser.add_argument(
        '--html',
        metavar='FILE',
        type=path_of,
        help='write a report to hand in: one page with all tables, those by state among them, '
        'figures, graphs, and what each word means',
    )
    parser.add_argument('--csv', metavar='FILE', type=path_of, help='write one line a trial')
    parser.add_argument(
        '--by',
        choices=BY,
        help='compare the trials of each experiment by this, with tests: paired where their seeds '
        'pair, else not. Several FOLDERs are the groups of --by folder',
    )
    parser.add_argument(
        '--by-state',
        action='store_true',
        help='print what happened in each state: visits, failures and why, the ways on, questions, '
        'and what they cost. --json and --csv then write it, too',
    )
    parser.add_argument(
        '--failing-outcomes',
        nargs='+',
        metavar='NAME',
        help='outcomes of a trial that are failures, whole or as a suffix; all others are then '
        'successes (default: each trial is counted by the rule that its record names)',
    )
    add_options(parser, 'counts the bags')
    args = parser.parse_args(argv)
    if args.scheduler and args.html:
        parser.error('--scheduler: not with --html, whose report reads the bags here')
    if args.without_tls and not args.scheduler:
        parser.error('--without-tls: name a --scheduler')
    return args


def _write_files(
    args: argparse.Namespace,
    found: Trials,
    variants: List[VariantCounts],
    states: Optional[List['VariantStates']],
    groups: Optional[List[TrialGroup]],
) -> None:
    if args.json:
        with open(args.json, 'w', encoding='utf-8') as target:
            more: Dict[str, Any] = {}
            if states is not None:
                from .by_state.rows import rows_of

                more['by_state'] = rows_of(states)
            if groups is not None:
                from .comparing.report import groups_data

                more['compared'] = groups_data(args.by, groups)
            table.write_json(target, variants, found.trials, found.skipped, more)
    if args.csv:
        with open(args.csv, 'w', encoding='utf-8', newline='') as target:
            table.write_csv(target, found.trials)
        if states is not None:
            from .by_state.rows import write_csv_files

            write_csv_files(args.csv, states)
    if args.figure:
        _write_figures(args, found.trials)


def _write_report(
    args: argparse.Namespace,
    rule: Optional[FailureRule],
    found: Trials,
    groups: Optional[List[TrialGroup]],
) -> None:
    from .reporting.contents import ReportOptions  # with Jinja2 and matplotlib
    from .reporting.events_again import EventsAgain
    from .reporting.page import write_report

    write_report(
        args.html,
        found,
        EventsAgain(found.trials),
        ReportOptions(args.folders, rule, args.by or '', args.x_axis),
        groups,
    )
    sys.stdout.write('Report: {}\n'.format(os.path.abspath(args.html)))


def _write_figures(args: argparse.Namespace, trials: Sequence[TrialSummary]) -> None:
    from .figure import save_time_series  # matplotlib takes a second: only where it is wanted

    stem = re.sub(r'\.(svg|png)$', '', args.figure)
    series = time_series(trials)
    for words, chosen in series:
        suffix = (
            ''
            if len(series) == 1
            else '_' + re.sub(r'[^A-Za-z0-9._-]+', '_', '_'.join(words)).strip('_')
        )
        for path in save_time_series(chosen, stem + suffix, args.columns, args.x_axis):
            sys.stdout.write('Figure: {}\n'.format(os.path.abspath(path)))
