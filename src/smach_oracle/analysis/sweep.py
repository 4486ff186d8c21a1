"""How often the expert was asked, by the oracle's memory and policy: experiments with several oracles side by side.

Prints, for each setting that trials were run with, in how many the expert was asked, the oracle recovered, the trial
truly succeeded, with 95% intervals over trials and, where there are several, over replicates; and draws interventions
as a function of the memory N (paper, section IV-A: "since this memory is a tunable parameter, the frequency of expert
intervention can be set"). Exit code: 0, all bags were read; 1, some were skipped; 2, there was nothing to count.
"""
import argparse
import os
import sys
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from ..oracle.paths import path_of
from .bag_events import BagError
from .groups import ENDED_IN_FAILURE, QUESTIONS, RECOVERIES, TRUE_SUCCESS, Arm, Count, find_arms, make_group
from .table import over_replicates, percent
from .reading import complain, tell_skipped
from .trials import load_trials


class Point(NamedTuple):
    """The trials of one experiment under one oracle."""

    experiment: str
    label: str  # every setting but the memory, as far as they differ
    memory: Optional[int]
    runs: int
    replicates: int
    asked: Count
    recovered: Count
    failed: Count
    true_success: Optional[Count]


def find_points(arms: Sequence[Arm]) -> List[Point]:
    """The arms with an oracle, by experiment, label and memory."""
    arms = [arm for arm in arms if arm.recovers]
    points = []
    for arm in arms:
        group = make_group(arm)
        memory = arm.settings.get('memory')
        truth = group.of(TRUE_SUCCESS) if group.truth_known else None
        points.append(Point(arm.experiment, _label(arm, arms), memory if isinstance(memory, int) else None, group.runs,
                            group.replicates, group.of(QUESTIONS), group.of(RECOVERIES), group.of(ENDED_IN_FAILURE),
                            truth))
    return sorted(points, key=lambda point: (point.experiment, point.label, point.memory or 0))


def _label(arm: Arm, arms: Sequence[Arm]) -> str:
    """E.g. "prose", or "algorithm1, high_from 0.8" where other arms have another."""
    others = [other.settings for other in arms if other.experiment == arm.experiment]
    differing = [key for key in sorted(arm.settings) if key not in ('memory', 'policy')
                 and any(other.get(key) != arm.settings[key] for other in others)]
    return ', '.join([str(arm.settings.get('policy', 'policy unknown'))]
                     + ['{} {}'.format(key, arm.settings[key]) for key in differing])


def format_points(points: Sequence[Point]) -> str:
    """A table for each experiment and label."""
    lines: List[str] = []
    for experiment, label in _parts(points):
        chosen = [point for point in points if (point.experiment, point.label) == (experiment, label)]
        lines += ['', '{}, {}'.format(experiment, label), '  {:>8}{:>8}   {:<29}{:<20}{:<29}{:<10}{}'.format(
            'memory N', 'runs', 'expert asked (95% interval)', 'over replicates', 'oracle recovered', 'failed',
            'true success')]
        lines += [_line(point) for point in chosen]
    return '\n'.join(lines[1:]) + '\n'


def _parts(points: Sequence[Point]) -> List[Tuple[str, str]]:
    return list(dict.fromkeys((point.experiment, point.label) for point in points))


def _line(point: Point) -> str:
    return '  {:>8}{:>8}   {:<29}{:<20}{:<29}{:<10}{}'.format(
        '?' if point.memory is None else point.memory, point.runs, _with_interval(point.asked),
        over_replicates(point.asked).strip(), _with_interval(point.recovered),
        '{:.1f}%'.format(100 * point.failed.share),
        'unknown' if point.true_success is None else _with_interval(point.true_success)).rstrip()


def _with_interval(count: Count) -> str:
    return '{:.1f}% ({})'.format(100 * count.share, ' '.join(percent(count.interval).split()))


def save_figure(points: Sequence[Point], stem: str) -> List[str]:
    """Draw interventions over memory to `stem`.svg and `stem`.png; returns the paths. Raises OSError."""
    from .sweep_figure import save  # matplotlib takes a second: only where it is wanted
    return save(by_label(points), stem)


def by_label(points: Sequence[Point]) -> Dict[str, List[Point]]:
    """Points with a memory, by what the figure's legend calls them."""
    several = len({point.experiment for point in points}) > 1
    series: Dict[str, List[Point]] = {}
    for point in points:
        if point.memory is not None:
            name = '{}, {}'.format(point.experiment, point.label) if several else point.label
            series.setdefault(name, []).append(point)
    return series


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog='compare_oracles', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folders', nargs='+', metavar='FOLDER', type=path_of,
                        help='with bags in it or below it; or a bag')
    parser.add_argument('--figure', metavar='OUT', type=path_of, help='write the figure to OUT.svg and OUT.png')
    args = parser.parse_args(argv)
    try:
        found = load_trials(args.folders)
        code = tell_skipped(found.skipped)
        points = find_points(find_arms(found.trials))
        if not points:
            raise BagError('no trials with an oracle in {}'.format(', '.join(args.folders)))
        sys.stdout.write(format_points(points))
        for path in save_figure(points, args.figure) if args.figure else []:
            sys.stdout.write('Figure: {}\n'.format(os.path.abspath(path)))
    except (BagError, OSError, ImportError) as err:
        return complain('compare_oracles', err)
    return code
