"""Compare variants trial by trial, from CSV files: no bag is needed.

Of files that `bag_statistics FOLDER --csv OUT` has written it prints a table of the groups, and
tests of each two: --by says what makes a group. They are paired where each trial has a seed.

Of results.csv, the rows that an experiment of run_trials has kept, it prints for each variant the
shares of trials with their intervals, and its cost for a trial and for a robot hour. It prints the
best that any variant did in each trial that all ran (hindsight), beside what each did there. It
prints McNemar's exact test of the trials in which a person was needed, of `default` against each
other variant, or of each two. Where there are rows of its variants, it prints the verdicts on the
hypotheses of doc/protocol.md. Exit code: 0, or 2 if there was nothing to read.
"""

import argparse
import statistics
import sys
from pathlib import Path
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.settings.paths import path_of

from .bag_events import BagError
from .compare_command.inputs import InputKind, csv_kind
from .compare_command.statistics_csv import BY_OF_CSV, compared_files
from .intervals import Interval, replicate_interval, wilson_interval
from .judging.hypotheses import undecided, verdicts
from .pairing import (
    COMPARED,
    HINDSIGHT,
    Happened,
    hindsight,
    on_common_seeds,
    paired_counts,
    pairs_to_test,
)
from .reading import report_error
from .trial_counter import EXPERT_ANSWERED, PERSON_NEEDED, ended_otherwise
from .trial_rows import LOST, TrialRow, read_rows

SECONDS_PER_HOUR = 3600.0


class Group(NamedTuple):
    """The rows that may be compared."""

    task: str
    share: Optional[float]  # of the causes that last. None means the world's own
    extra_causes: bool  # each has one of the extra kinds, and none of the usual ones
    goes_on: bool  # their world goes on from one to the next

    @property
    def told(self) -> str:
        """Return what sets it apart from the other rows of its task, '' where nothing does."""
        if self.extra_causes:
            return ', extra causes'
        if self.goes_on:
            return ', continuous operation'
        return '' if self.share is None else ', {:.0%} of the causes last'.format(self.share)


SHARES: Tuple[Tuple[str, Happened], ...] = (
    ('true success', lambda row: row.succeeded),
    (PERSON_NEEDED, lambda row: row.intervened),
    ('a question asked', lambda row: row.questions > 0),
    (EXPERT_ANSWERED, lambda row: row.answered > 0),
    ('recovered', lambda row: row.recovered),
    ('with attempts', lambda row: row.attempts > 0),
    ('false success', lambda row: row.ending == 'success' and not row.succeeded),
    ('lost or hung', lambda row: row.ending == LOST),
)


class Share(NamedTuple):
    """A share of the trials of a variant."""

    name: str
    trials: int
    of: int
    interval: Interval  # 95% Wilson score interval
    # the smallest and the largest share of a replicate, or None for fewer than two
    over_replicates: Optional[Interval]
    of_mean: Optional[Interval] = None  # Student's 95% interval of the mean of the replicates

    @property
    def share(self) -> float:
        """Return the share, 0 to 1."""
        return self.trials / self.of


class Costs(NamedTuple):
    """The costs of a variant's trials. None means that the cost of some trial is not known."""

    attempts: float  # a trial
    questions: float  # a trial
    questions_per_hour: Optional[float]  # of the robot's time
    expert_s: Optional[float]  # a trial
    expert_s_per_hour: Optional[float]
    wrong_objects: Optional[int]
    damage: Optional[float]  # things that came to harm in any trial, for each true success
    damage_done: Optional[float]  # of these, in a trial of true success
    completion_s: Optional[float]  # median time of a true success
    trials_between: Optional[float]  # trials for each that needed a person. None: none did
    hours_between: Optional[float]


def shares_of(rows: Sequence[TrialRow]) -> List[Share]:
    """Return the shares of the trials of one variant."""
    parts: Dict[int, List[TrialRow]] = {}
    for row in rows:
        parts.setdefault(row.replicate, []).append(row)
    shares = list(SHARES)
    if any(map(ended_otherwise, rows)):
        shares.append(('other end', ended_otherwise))
    return [_share(name, happened, rows, list(parts.values())) for name, happened in shares]


def _share(
    name: str, happened: Happened, rows: Sequence[TrialRow], parts: Sequence[Sequence[TrialRow]]
) -> Share:
    number = sum(map(happened, rows))
    shares = [sum(map(happened, part)) / len(part) for part in parts]
    return Share(
        name,
        number,
        len(rows),
        wilson_interval(number, len(rows)),
        (min(shares), max(shares)) if len(shares) > 1 else None,
        replicate_interval(shares),
    )


def costs_of(rows: Sequence[TrialRow]) -> Costs:
    """Return what the trials of one variant cost.

    Lost trials count as trials. Nothing else is known of them, and they are left out of what is
    known of all others.
    """
    ended = [row for row in rows if row.ending != LOST]
    asked, needed = sum(row.questions for row in rows), sum(row.intervened for row in rows)
    hours = robot_hours(ended)
    expert_s = _total(ended, lambda row: row.expert_s)
    done = [row for row in ended if row.succeeded]
    times = [row.sim_s for row in done if row.sim_s is not None]
    wrong = [row.wrong_object for row in ended]
    return Costs(
        sum(row.attempts for row in rows) / len(rows),
        asked / len(rows),
        _ratio(asked, hours),
        _ratio(expert_s, len(ended)),
        _ratio(expert_s, hours),
        None if None in wrong else sum(map(bool, wrong)),
        _ratio(_total(ended, lambda row: row.damage), len(done)),
        _ratio(_total(done, lambda row: row.damage), len(done)),
        statistics.median(times) if times else None,
        _ratio(len(rows), needed),
        _ratio(hours, needed),
    )


def common_completion(variants: Mapping[str, Sequence[TrialRow]]) -> Tuple[int, Dict[str, float]]:
    """Return the median times (s) of the variants that are compared, on seeds that all completed.

    Each variant completes other trials: the fewer it completes, the easier they are.

    :returns: the number of seeds, and the medians. 0 and none where there are no such.
    """
    if any(name not in variants for name in COMPARED):
        return 0, {}
    times = {
        name: {
            row.pair: row.sim_s for row in variants[name] if row.succeeded and row.sim_s is not None
        }
        for name in COMPARED
    }
    seeds = set.intersection(*(set(each) for each in times.values()))
    if not seeds:
        return 0, {}
    return len(seeds), {
        name: statistics.median(each[pair] for pair in seeds) for name, each in times.items()
    }


def robot_hours(rows: Sequence[TrialRow]) -> Optional[float]:
    """Return how long robots were at work in trials that have ended. None means not known of some.

    Where a world goes on, the time from one trial to the next counts, too.
    """
    by_replicate: Dict[int, List[float]] = {}
    for row in rows:
        if row.hour is not None and row.sim_s is not None:
            by_replicate.setdefault(row.replicate, []).extend(
                (row.hour, row.hour + row.sim_s / SECONDS_PER_HOUR)
            )
    if rows and sum(map(len, by_replicate.values())) == 2 * len(rows):
        return sum(max(each) - min(each) for each in by_replicate.values())
    return _total(rows, lambda row: row.sim_s, SECONDS_PER_HOUR)


def _total(
    rows: Sequence[TrialRow], value: Callable[[TrialRow], Optional[float]], unit: float = 1.0
) -> Optional[float]:
    values = [value(row) for row in rows]
    known = [each for each in values if each is not None]
    return sum(known) / unit if len(known) == len(values) and values else None


def _ratio(above: Optional[float], below: Optional[float]) -> Optional[float]:
    return above / below if above is not None and below else None


def format_comparison(rows: Sequence[TrialRow]) -> str:
    """Return the tables, one task after the other."""
    texts = []
    for group, mine in groups_of(rows).items():
        variants = by_variant(mine)
        texts += ['{}{}\n'.format(group.task, group.told)] + [
            _variant(*each) for each in variants.items()
        ]
        texts += _same_seeds(mine) + _tests(variants)
    return '\n'.join(texts)


def by_variant(rows: Sequence[TrialRow]) -> Dict[str, List[TrialRow]]:
    """Return the rows of each variant: those that are compared first, then as they were begun."""
    found: Dict[str, List[TrialRow]] = {}
    for row in rows:
        found.setdefault(row.variant, []).append(row)
    first = [name for name in COMPARED if name in found]
    return {name: found[name] for name in dict.fromkeys([*first, *found])}


def with_hindsight(rows: Sequence[TrialRow]) -> Dict[str, List[TrialRow]]:
    """Return the rows of each variant on the seeds that all of them ran, and HINDSIGHT's.

    It is empty where there are no such seeds, or no two variants.
    """
    best = hindsight(rows)
    found = by_variant(on_common_seeds(rows))
    return {**found, HINDSIGHT: best} if len(found) > 1 else {}


def _same_seeds(rows: Sequence[TrialRow]) -> List[str]:
    """Tell the bound, beside each variant on the same seeds."""
    found = with_hindsight(rows)
    if not found:
        return []
    lines = ['  on the {} seeds that all variants ran:'.format(len(found[HINDSIGHT]))]
    for name, mine in found.items():
        true, needed = shares_of(mine)[:2]
        lines.append(
            '    {:<24}{:>7.1%} true success {:>7.1%} person needed'.format(
                name, true.share, needed.share
            )
        )
    return ['\n'.join(lines) + '\n']


def groups_of(rows: Sequence[TrialRow]) -> Dict[Group, List[TrialRow]]:
    """Return the rows that may be compared: of one task, and with the same kinds of causes."""
    found: Dict[Group, List[TrialRow]] = {}
    for row in rows:
        group = Group(row.task, row.lasting_share, bool(row.extra_causes), row.hour is not None)
        found.setdefault(group, []).append(row)
    return dict(sorted(found.items(), key=lambda each: _place_of(each[0])))


def _place_of(group: Group) -> Tuple[str, bool, bool, float]:
    return group.task, group.extra_causes, group.goes_on, group.share or 0.0


def _variant(name: str, rows: Sequence[TrialRow]) -> str:
    lines = [
        '  {} ({} trials, {} replicates)'.format(
            name, len(rows), len({row.replicate for row in rows})
        )
    ]
    for share in shares_of(rows):
        over = share.over_replicates
        lines.append(
            '    {:<18}{:>5} {:>7.1%} ({:.1%} to {:.1%}){}'.format(
                share.name,
                share.trials,
                share.share,
                share.interval[0],
                share.interval[1],
                '' if over is None else '; replicates {:.1%} to {:.1%}'.format(*over),
            )
        )
    lines += [
        '    {:<42}{}'.format(told.replace('_', ' '), _number(value))
        for told, value in zip(_COSTS, costs_of(rows))
    ]
    return '\n'.join(lines) + '\n'


_COSTS = (
    'attempts a trial',
    'questions a trial',
    'questions a robot hour',
    'expert s a trial',
    'expert s a robot hour',
    'trials with a wrong object',
    'damage for each completed task',
    'damage in a completed task',
    's to completion, median',
    'trials per person needed',
    'robot hours per person needed',
)


def _number(value: Optional[float]) -> str:
    return '-' if value is None else '{:.3g}'.format(value)


def _tests(variants: Dict[str, List[TrialRow]]) -> List[str]:
    lines = []
    for first, second in pairs_to_test(list(variants)):
        counts = paired_counts(variants[first], variants[second], lambda row: row.intervened)
        if sum(counts):
            lines.append(
                '  person needed, {} against {}: {} trials under {} alone, {} under {} alone, '
                'of {} that both ran; McNemar p = {:.3g}'.format(
                    first,
                    second,
                    counts.first_alone,
                    first,
                    counts.second_alone,
                    second,
                    sum(counts),
                    counts.p_value,
                )
            )
    return ['\n'.join(lines) + '\n'] if lines else []


def main(argv: Optional[Sequence[str]] = None, command: str = 'compare variants') -> int:
    """Run the command, and return its exit code.

    :param command: its name in messages.
    """
    parser = argparse.ArgumentParser(
        prog=command,
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        'files',
        nargs='+',
        metavar='FILE',
        type=path_of,
        help='of bag_statistics --csv, or results.csv of an experiment: all of one kind',
    )
    parser.add_argument(
        '--by',
        choices=BY_OF_CSV,
        help='compare the trials in files of bag_statistics by this (default: file, or settings '
        'where there is one FILE)',
    )
    args = parser.parse_args(argv)
    try:
        if csv_kind(args.files) is InputKind.STATISTICS:
            sys.stdout.write(compared_files(args.files, args.by))
            return 0
        if args.by:
            raise BagError('--by: rows of run_trials are compared by variant')
        rows = [row for name in args.files for row in read_rows(Path(name))]
        if not rows:
            raise BagError('{}: no trials in it'.format(', '.join(args.files)))
    except (BagError, OSError) as err:
        return report_error(command, err)
    sys.stdout.write(format_comparison(rows))
    sys.stdout.write(verdicts_text(rows))
    return 0


def verdicts_text(rows: Sequence[TrialRow]) -> str:
    """Return the verdicts on the hypotheses as a text, '' where rows decide none."""
    told = verdicts(rows) + undecided(rows)
    return '\n'.join(['Hypotheses (doc/protocol.md)', *told]) + '\n' if told else ''
