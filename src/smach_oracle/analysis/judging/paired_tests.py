"""Tests of hypotheses about pairs of trials: the same trial under two variants."""

import itertools
import math
import random
from typing import Callable, NamedTuple, Sequence, Tuple

from ..intervals import Interval
from ..pairing import PairedCounts

ONE_SIDED = 0.025  # level of each test
Z_POWER = 0.8416212335729143  # of a power of 0.8
Z_LEVEL = 1.959963984540054  # of ONE_SIDED
MOST_EXACT = 20  # differing pairs, of which all signs are tried
DRAWS = 100_000
_STEPS = 100  # of a bisection: the interval is exact to the last digits


def normal_tail(z: float) -> float:
    """Return the chance of a standard normal value below `z`."""
    return math.erfc(-z / math.sqrt(2)) / 2


# -- the difference of two paired shares


def tango_z(first_alone: int, second_alone: int, pairs: int, difference: float) -> float:
    """Return the score statistic of a difference of two paired shares, the first less the second.

    It is T. Tango's (Stat. Med. 17, 1998, p. 891). The variance is that of the most likely shares
    which have this difference.

    :raises ValueError: for counts that are not of so many pairs, or a difference not between -1, 1.
    """
    if min(first_alone, second_alone) < 0 or first_alone + second_alone > pairs or not pairs:
        raise ValueError(
            'pairs: {!r} is not allowed; allowed: 1 or more, the differing ones among them'.format(
                (first_alone, second_alone, pairs)
            )
        )
    if not -1 < difference < 1:
        raise ValueError('difference: {!r} is not allowed; allowed: -1 to 1'.format(difference))
    linear = (2 * pairs - first_alone + second_alone) * difference - first_alone - second_alone
    constant = -second_alone * difference * (1 - difference)
    root = math.sqrt(max(0.0, linear * linear - 8 * pairs * constant))
    second = (root - linear) / (4 * pairs)
    variance = pairs * (2 * second + difference * (1 - difference))
    distance = first_alone - second_alone - pairs * difference
    if variance <= 0:
        return 0.0 if not distance else math.copysign(math.inf, distance)
    return distance / math.sqrt(variance)


def tango_interval(first_alone: int, second_alone: int, pairs: int, z: float = Z_LEVEL) -> Interval:
    """Return Tango's score interval of a difference of two paired shares, of 95% by default."""
    estimate = (first_alone - second_alone) / pairs

    def inside(difference: float) -> bool:
        return abs(tango_z(first_alone, second_alone, pairs, difference)) <= z

    return _end(inside, estimate, -1.0), _end(inside, estimate, 1.0)


def _end(inside: Callable[[float], bool], within: float, beyond: float) -> float:
    """Return where an interval ends, between a value within it and one that is not beyond it."""
    for _ in range(_STEPS):
        middle = (within + beyond) / 2
        if abs(middle) < 1 and inside(middle):
            within = middle
        else:
            beyond = middle
    return within


def not_worse(counts: PairedCounts, margin: float) -> float:
    """Return the one-sided p-value of the first share not being larger by the margin.

    Something bad is counted. Under the null hypothesis the first share is larger by the margin, or
    more.
    """
    pairs = sum(counts)
    if not pairs:
        return 1.0
    return normal_tail(tango_z(counts.first_alone, counts.second_alone, pairs, margin))


# -- the ratio of two paired shares


def ratio_z(counts: PairedCounts, ratio: float) -> float:
    """Return the score statistic of a ratio of two paired shares, the first by the second.

    It is that of N.-S. Tang, M.-L. Tang and I. S. F. Chan (Stat. Med. 22, 2003, p. 1217). 0 where
    neither has happened.
    """
    both, first_alone, second_alone, _ = counts
    pairs, happened = sum(counts), both + first_alone + second_alone
    if not happened:
        return 0.0
    squared = pairs * (1 + ratio)
    linear = (both + second_alone) * ratio * ratio - (both + first_alone + 2 * second_alone)
    constant = second_alone * (1 - ratio) * happened / pairs
    root = math.sqrt(max(0.0, linear * linear - 4 * squared * constant))
    second = (root - linear) / (2 * squared)
    variance = pairs * (1 + ratio) * second + happened * (ratio - 1)
    distance = both + first_alone - ratio * (both + second_alone)
    if variance <= 1e-12:
        return 0.0 if not distance else math.copysign(math.inf, distance)
    return distance / math.sqrt(variance)


def ratio_interval(counts: PairedCounts, z: float = Z_LEVEL) -> Interval:
    """Return the score interval of a ratio of two paired shares, of 95% by default."""
    first, second = counts.both + counts.first_alone, counts.both + counts.second_alone

    def inside(log_ratio: float) -> bool:
        return abs(ratio_z(counts, math.exp(log_ratio))) <= z

    farthest = 20.0  # of the logarithm
    middle = math.log(first / second) if first and second else (-farthest if second else farthest)
    low, high = -farthest, farthest
    within_low = within_high = middle
    for _ in range(_STEPS):
        low, within_low = _halved(inside, low, within_low)
        high, within_high = _halved(inside, high, within_high)
    return (
        math.exp(within_low) if first else 0.0,
        math.exp(within_high) if second else math.inf,
    )


def _halved(inside: Callable[[float], bool], beyond: float, within: float) -> Tuple[float, float]:
    middle = (beyond + within) / 2
    return (beyond, middle) if inside(middle) else (middle, within)


def less_than_a_part(counts: PairedCounts, part: float) -> float:
    """Return the one-sided p-value of the first share being less than a part of the second."""
    return normal_tail(ratio_z(counts, part)) if sum(counts) else 1.0


# -- paired costs


class CostTest(NamedTuple):
    """A test of whether one variant costs less than another on the same trials."""

    pairs: int
    mean: float  # difference of the costs, the first less the second
    p_value: float  # one-sided
    exact: bool  # all signs were tried


def costs_less(
    first: Sequence[float], second: Sequence[float], seed: int = 0, draws: int = DRAWS
) -> CostTest:
    """Test whether the first costs less, by permutation within each pair (R. A. Fisher, 1935).

    Under the null hypothesis either variant might have had either cost of a pair. All signs are
    tried where at most 20 pairs differ. Otherwise they are drawn.
    """
    differences = [one - other for one, other in zip(first, second)]
    apart = [each for each in differences if each]
    mean = math.fsum(differences) / len(differences) if differences else 0.0
    if not apart:
        return CostTest(len(differences), mean, 1.0, True)
    observed = math.fsum(apart)
    most = observed + 1e-9 * math.fsum(map(abs, apart))  # binary rounding costs nothing
    if len(apart) <= MOST_EXACT:
        # the sums of all signs of each half, so that none is added up twice
        half = len(apart) // 2
        left, right = _signed_sums(apart[:half]), sorted(_signed_sums(apart[half:]))
        at_most = sum(_count_to(right, most - each) for each in left)
        return CostTest(len(differences), mean, at_most / 2 ** len(apart), True)
    rng = random.Random('costs {}'.format(seed))
    # the sums of all signs of each eight differences, of which a byte draws one
    tables = [_signed_sums(apart[begin : begin + 8]) for begin in range(0, len(apart), 8)]
    found = 0
    for _ in range(draws):
        signs = rng.getrandbits(8 * len(tables)).to_bytes(len(tables), 'big')
        total = sum(table[sign % len(table)] for table, sign in zip(tables, signs))
        found += total <= most
    return CostTest(len(differences), mean, (found + 1) / (draws + 1), False)


def _signed_sums(values: Sequence[float]) -> Sequence[float]:
    return [
        sum(sign * value for sign, value in zip(signs, values))
        for signs in itertools.product((1, -1), repeat=len(values))
    ]


def _count_to(in_order: Sequence[float], most: float) -> int:
    low, high = 0, len(in_order)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if in_order[middle] <= most else (low, middle)
    return low


# -- how many pairs


def power_where_equal(discordant: int, pairs: int, margin: float) -> float:
    """Return the power of `not_worse` where both shares are equal, by the pairs that differ alone.

    Which variant they speak for does not matter, so whoever looks at it learns nothing of that.
    """
    if not pairs:
        return 0.0
    if not discordant:
        return 1.0
    return normal_tail(margin * pairs / math.sqrt(discordant) - Z_LEVEL)


def needs_more(discordant: int, pairs: int, margin: float) -> bool:
    """Whether the experiment is extended: its power would be below 0.8 where both are equal."""
    return power_where_equal(discordant, pairs, margin) < 0.8
