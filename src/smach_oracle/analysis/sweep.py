"""Count how often the expert was asked, by the oracle's memory and policy.

Prints for each setting in how many trials the expert was asked, in how many the oracle recovered,
how many truly succeeded, and how many needed a person. Intervals of 95% are over trials and, if
there are several, over replicates. Draws the share of trials with a question over the memory N
(paper, section IV-A: "since this memory is a tunable parameter, the frequency of expert
intervention can be set"). Exit code: 0, all bags were read; 1, some were skipped; 2, there was
nothing to count.
"""

import argparse
import os
import sys
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.settings.paths import path_of

from .bag_events import BagError
from .compare_command.inputs import instead_of_bags
from .reading import report_error, report_skipped, rule_of
from .table import over_replicates, percent
from .trial_counter import PERSON_NEEDED
from .trials import load_trials
from .variants import (
    ENDED_IN_FAILURE,
    QUESTIONS,
    RECOVERIES,
    TRUE_SUCCESS,
    Count,
    VariantTrials,
    count_variant,
    find_variants,
)


class SweepPoint(NamedTuple):
    """The trials of one experiment under one oracle."""

    experiment: str
    label: str  # every setting but the memory, as far as they differ
    memory: Optional[int]
    trials: int
    replicates: int
    asked: Count
    recovered: Count
    failed: Count
    true_success: Optional[Count]
    needed: Count  # of a person, at least where `unjudged` is above 0
    unjudged: int = 0


def find_points(variants: Sequence[VariantTrials]) -> List[SweepPoint]:
    """Return the variants with an oracle, by experiment, label and memory."""
    variants = [variant for variant in variants if variant.recovers]
    points = []
    for variant in variants:
        counts = count_variant(variant)
        memory = variant.settings.get('memory')
        truth = counts.of(TRUE_SUCCESS) if counts.truth_known else None
        points.append(
            SweepPoint(
                variant.experiment,
                _label(variant, variants),
                memory if isinstance(memory, int) else None,
                counts.trials,
                counts.replicates,
                counts.of(QUESTIONS),
                counts.of(RECOVERIES),
                counts.of(ENDED_IN_FAILURE),
                truth,
                counts.of(PERSON_NEEDED),
                counts.unjudged,
            )
        )
    return sorted(points, key=lambda point: (point.experiment, point.label, point.memory or 0))


def _label(variant: VariantTrials, variants: Sequence[VariantTrials]) -> str:
    """E.g. "prose", or "algorithm1, high_from 0.8" where other variants have another."""
    others = [other.settings for other in variants if other.experiment == variant.experiment]
    differing = [
        key
        for key in sorted(variant.settings)
        if key not in ('memory', 'policy')
        and any(other.get(key) != variant.settings[key] for other in others)
    ]
    return ', '.join(
        [str(variant.settings.get('policy', 'policy unknown'))]
        + ['{} {}'.format(key, variant.settings[key]) for key in differing]
    )


# what a table shows of a point behind its memory and trials, each with the width of its column
_ASKED, _OVER, _RECOVERED, _FAILED, _TRUE = (
    'expert asked (95% interval)',
    'over replicates',
    'oracle recovered',
    'failed',
    'true success',
)
_WIDE = ({_ASKED: 29, _OVER: 20, _RECOVERED: 29, _FAILED: 10, _TRUE: 29, PERSON_NEEDED: 0},)
_NARROW = (
    {_ASKED: 29, _OVER: 17, PERSON_NEEDED: 0},  # 100 columns with the longest numbers
    {_RECOVERED: 29, _TRUE: 29, _FAILED: 0},
)


def format_points(points: Sequence[SweepPoint], wide: bool = False) -> str:
    """Return for each experiment and label two tables of at most 100 columns, or one wide one."""
    lines: List[str] = []
    for experiment, label in _parts(points):
        chosen = [
            point for point in points if (point.experiment, point.label) == (experiment, label)
        ]
        lines += ['', '{}, {}'.format(experiment, label)]
        for columns in _WIDE if wide else _NARROW:
            lines.append(_row('memory N', 'trials', {name: name for name in columns}, columns))
            lines += [
                _row(
                    '?' if each.memory is None else each.memory, each.trials, _cells(each), columns
                )
                for each in chosen
            ]
    return '\n'.join(lines[1:]) + '\n'


def _parts(points: Sequence[SweepPoint]) -> List[Tuple[str, str]]:
    return list(dict.fromkeys((point.experiment, point.label) for point in points))


def _row(
    memory: object, trials: object, cells: Mapping[str, str], columns: Mapping[str, int]
) -> str:
    told = ''.join('{:<{}}'.format(cells[name], width) for name, width in columns.items())
    return '  {:>8}{:>8}   {}'.format(memory, trials, told).rstrip()


def _cells(point: SweepPoint) -> Dict[str, str]:
    true = point.true_success
    return {
        _ASKED: _with_interval(point.asked),
        _OVER: over_replicates(point.asked).strip(),
        _RECOVERED: _with_interval(point.recovered),
        _FAILED: '{:.1f}%'.format(100 * point.failed.share),
        _TRUE: 'unknown' if true is None else _with_interval(true),
        PERSON_NEEDED: ('at least ' if point.unjudged else '') + _with_interval(point.needed),
    }


def _with_interval(count: Count) -> str:
    return '{:.1f}% ({})'.format(100 * count.share, ' '.join(percent(count.interval).split()))


def save_figure(points: Sequence[SweepPoint], stem: str) -> List[str]:
    """Draw questions over memory to `stem`.svg and `stem`.png, and return the paths.

    :raises OSError: where a file cannot be written.
    """
    from .sweep_figure import save  # matplotlib takes a second: only where it is wanted

    return save(by_label(points), stem)


def by_label(points: Sequence[SweepPoint]) -> Dict[str, List[SweepPoint]]:
    """Return the points with a memory, by what the figure's legend calls them."""
    several = len({point.experiment for point in points}) > 1
    series: Dict[str, List[SweepPoint]] = {}
    for point in points:
        if point.memory is not None:
            name = '{}, {}'.format(point.experiment, point.label) if several else point.label
            series.setdefault(name, []).append(point)
    return series


def main(argv: Optional[Sequence[str]] = None, command: str = 'compare oracles') -> int:
    """Run the command, and return its exit code.

    :param command: its name in messages.
    """
    parser = argparse.ArgumentParser(
        prog=command,
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
        '--figure', metavar='STEM', type=path_of, help='write the figure to STEM.svg and STEM.png'
    )
    parser.add_argument(
        '--failing-outcomes',
        nargs='+',
        metavar='NAME',
        help='outcomes of a trial that are failures, whole or as a suffix; all others are then '
        'successes (default: each trial is counted by the rule that its record names)',
    )
    parser.add_argument(
        '--wide',
        action='store_true',
        help='one table of 150 columns in place of two of at most 100',
    )
    args = parser.parse_args(argv)
    try:
        found = load_trials(args.folders, rule_of(command, args.failing_outcomes))
        code = report_skipped(found.skipped)
        points = find_points(find_variants(found.trials))
        if not points:
            raise BagError('no trials with an oracle in {}'.format(', '.join(args.folders)))
        sys.stdout.write(format_points(points, args.wide))
        for path in save_figure(points, args.figure) if args.figure else []:
            sys.stdout.write('Figure: {}\n'.format(os.path.abspath(path)))
    except (BagError, OSError, ImportError) as err:
        return report_error(command, instead_of_bags(err, args.folders))
    return code
