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
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.settings.paths import path_of

from .bag_events import BagError
from .reading import report_error, report_skipped
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


def format_points(points: Sequence[SweepPoint]) -> str:
    """Return a table for each experiment and label."""
    lines: List[str] = []
    for experiment, label in _parts(points):
        chosen = [
            point for point in points if (point.experiment, point.label) == (experiment, label)
        ]
        lines += [
            '',
            '{}, {}'.format(experiment, label),
            '  {:>8}{:>8}   {:<29}{:<20}{:<29}{:<10}{:<29}{}'.format(
                'memory N',
                'trials',
                'expert asked (95% interval)',
                'over replicates',
                'oracle recovered',
                'failed',
                'true success',
                PERSON_NEEDED,
            ),
        ]
        lines += [_line(point) for point in chosen]
    return '\n'.join(lines[1:]) + '\n'


def _parts(points: Sequence[SweepPoint]) -> List[Tuple[str, str]]:
    return list(dict.fromkeys((point.experiment, point.label) for point in points))


def _line(point: SweepPoint) -> str:
    return '  {:>8}{:>8}   {:<29}{:<20}{:<29}{:<10}{:<29}{}'.format(
        '?' if point.memory is None else point.memory,
        point.trials,
        _with_interval(point.asked),
        over_replicates(point.asked).strip(),
        _with_interval(point.recovered),
        '{:.1f}%'.format(100 * point.failed.share),
        'unknown' if point.true_success is None else _with_interval(point.true_success),
        ('at least ' if point.unjudged else '') + _with_interval(point.needed),
    ).rstrip()


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


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command, and return its exit code."""
    parser = argparse.ArgumentParser(
        prog='compare_oracles',
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
        '--figure', metavar='OUT', type=path_of, help='write the figure to OUT.svg and OUT.png'
    )
    args = parser.parse_args(argv)
    try:
        found = load_trials(args.folders)
        code = report_skipped(found.skipped)
        points = find_points(find_variants(found.trials))
        if not points:
            raise BagError('no trials with an oracle in {}'.format(', '.join(args.folders)))
        sys.stdout.write(format_points(points))
        for path in save_figure(points, args.figure) if args.figure else []:
            sys.stdout.write('Figure: {}\n'.format(os.path.abspath(path)))
    except (BagError, OSError, ImportError) as err:
        return report_error('compare_oracles', err)
    return code
