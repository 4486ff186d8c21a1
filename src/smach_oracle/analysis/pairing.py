"""Variants that ran the same trials, compared trial by trial."""

import itertools
import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from .trial_rows import Pair, TrialRow

HINDSIGHT = 'hindsight'  # name of the variant that is made of all others
BARE, DEFAULT, RESTART = COMPARED = ('bare', 'default', 'restart')  # names of variants
Happened = Callable[[TrialRow], bool]


class PairedCounts(NamedTuple):
    """Counts of trials in which something happened under both of two variants, one, or none."""

    both: int
    first_alone: int
    second_alone: int
    none: int

    @property
    def p_value(self) -> float:
        """Return the two-sided p-value of McNemar's exact test."""
        return mcnemar_exact(self.first_alone, self.second_alone)


def mcnemar_exact(first_alone: int, second_alone: int) -> float:
    """Return the two-sided p-value of McNemar's exact test.

    Under the null hypothesis each trial in which two variants differ is as likely to differ in one
    way as in the other (Q. McNemar, Psychometrika 12, 1947). 1.0 where none differs.

    :raises ValueError: for a number below 0.
    """
    if min(first_alone, second_alone) < 0:
        raise ValueError(
            'numbers of trials: {} is not allowed; allowed: 0 and more'.format(
                (first_alone, second_alone)
            )
        )
    differing = first_alone + second_alone
    tail = sum(math.comb(differing, count) for count in range(min(first_alone, second_alone) + 1))
    return float(min(1.0, 2 * tail / 2**differing))


def paired_counts(
    first: Sequence[TrialRow], second: Sequence[TrialRow], happened: Happened
) -> PairedCounts:
    """Compare two variants over the trials that both ran."""
    others = {row.pair: happened(row) for row in second}
    pairs = [(happened(row), others[row.pair]) for row in first if row.pair in others]
    return PairedCounts(
        *(
            pairs.count(each)
            for each in ((True, True), (True, False), (False, True), (False, False))
        )
    )


class Trend(NamedTuple):
    """A test of whether a share of trials grows with a number."""

    z: float  # above 0: it grows
    p_value: float  # two-sided


def trend_of(
    rows: Sequence[TrialRow], number_of: Callable[[TrialRow], float], happened: Happened
) -> Optional[Trend]:
    """Test whether something happens the oftener, the larger a number is.

    It is Mantel's extension test (N. Mantel, J. Am. Stat. Assoc. 58, 1963) with a stratum for each
    seed: Cochran and Armitage's for trials that are paired. Under the null hypothesis all orders of
    the trials of a seed are as likely. None where nothing differs within a seed.
    """
    by_pair: Dict[Pair, List[TrialRow]] = {}
    for row in rows:
        by_pair.setdefault(row.pair, []).append(row)
    total = variance = 0.0
    for each in by_pair.values():
        if len(each) > 1:
            numbers, events = (
                [number_of(row) for row in each],
                [float(happened(row)) for row in each],
            )
            total += _products(numbers, events)
            variance += _products(numbers, numbers) * _products(events, events) / (len(each) - 1)
    if not variance:
        return None
    z = total / math.sqrt(variance)
    return Trend(z, math.erfc(abs(z) / math.sqrt(2)))


def _products(some: Sequence[float], others: Sequence[float]) -> float:
    """Return the sum of the products of deviations from the means."""
    mean, other = sum(some) / len(some), sum(others) / len(others)
    return sum((x - mean) * (y - other) for x, y in zip(some, others))


def pairs_to_test(names: Sequence[str]) -> List[Tuple[str, str]]:
    """Return the variants to test against each other: DEFAULT against each other one.

    Without DEFAULT it is each two.
    """
    if DEFAULT in names:
        return [(DEFAULT, name) for name in names if name != DEFAULT]
    return list(itertools.combinations(names, 2))


def on_common_seeds(rows: Sequence[TrialRow], names: Sequence[str] = ()) -> List[TrialRow]:
    """Return the rows of the trials that all variants ran.

    :param names: those that must have run them. None are all that have rows.
    """
    wanted = set(names) or {row.variant for row in rows}
    ran: Dict[Pair, Set[str]] = {}
    for row in rows:
        ran.setdefault(row.pair, set()).add(row.variant)
    return [row for row in rows if wanted <= ran[row.pair]]


def hindsight(rows: Sequence[TrialRow]) -> List[TrialRow]:
    """Return the best that any variant did in each trial that all of them ran.

    Best is the row without an intervention, then the one that truly succeeded, then that with the
    fewest questions, then that with the least harm, then the shortest. It is a bound: nobody could
    have known which variant it would be.
    """
    by_pair: Dict[Pair, List[TrialRow]] = {}
    for row in on_common_seeds(rows):
        by_pair.setdefault(row.pair, []).append(row)
    return [
        min(each, key=_badness)._replace(variant=HINDSIGHT, learned='') for each in by_pair.values()
    ]


def _badness(row: TrialRow) -> Tuple[bool, bool, int, int, float, str]:
    return (
        row.intervened,
        not row.succeeded,
        row.questions,
        row.damage or 0,
        math.inf if row.sim_s is None else row.sim_s,
        row.variant,
    )
