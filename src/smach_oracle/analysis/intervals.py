"""Confidence intervals of shares: over trials, over replicates, and of a paired difference."""

import math
from typing import Optional, Sequence, Tuple

Z_95 = 1.959963984540054  # two-sided 95% quantile of the normal distribution
# The same of Student's t distribution, for 1, 2, ... degrees of freedom.
T_95 = (
    12.706,
    4.303,
    3.182,
    2.776,
    2.571,
    2.447,
    2.365,
    2.306,
    2.262,
    2.228,
    2.201,
    2.179,
    2.160,
    2.145,
    2.131,
    2.120,
    2.110,
    2.101,
    2.093,
    2.086,
    2.080,
    2.074,
    2.069,
    2.064,
    2.060,
    2.056,
    2.052,
    2.048,
    2.045,
    2.042,
)

Interval = Tuple[float, float]


def wilson_interval(successes: int, trials: int, z: float = Z_95) -> Interval:
    """Return the Wilson interval of a share (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927).

    (0, 1) where there are no trials.

    :raises ValueError: unless 0 <= successes <= trials.
    """
    if not 0 <= successes <= trials:
        raise ValueError('successes: {} is not allowed; allowed: 0 to {}'.format(successes, trials))
    if trials == 0:
        return 0.0, 1.0
    share = successes / trials
    centre = share + z * z / (2 * trials)
    half = z * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    scale = 1 + z * z / trials
    low = 0.0 if successes == 0 else (centre - half) / scale
    return low, 1.0 if successes == trials else (centre + half) / scale


def t_quantile(freedom: int) -> float:
    """Return the two-sided 95% quantile of Student's t distribution.

    It is for 1 degree of freedom or more.
    """
    if freedom <= len(T_95):
        return T_95[freedom - 1]
    # the first three terms of its expansion: within 0.0001
    return (
        Z_95
        + (Z_95**3 + Z_95) / (4 * freedom)
        + (5 * Z_95**5 + 16 * Z_95**3 + 3 * Z_95) / (96 * freedom**2)
    )


def replicate_interval(shares: Sequence[float]) -> Optional[Interval]:
    """Return Student's t interval of the mean of replicates' shares.

    It is cut to 0 to 1. None for one replicate.
    """
    count = len(shares)
    if count < 2:
        return None
    mean = sum(shares) / count
    variance = sum((share - mean) ** 2 for share in shares) / (count - 1)
    half = t_quantile(count - 1) * math.sqrt(variance / count)
    return max(0.0, mean - half), min(1.0, mean + half)


def paired_difference(both: int, first_alone: int, second_alone: int, none: int) -> Interval:
    """Return the interval of the difference of two paired shares, the first less the second.

    It is Newcombe's, from Wilson's intervals of the two (R. G. Newcombe, Stat. Med. 17, 1998,
    p. 2635, method 10). (-1, 1) where there are no pairs.
    """
    pairs = both + first_alone + second_alone + none
    if not pairs:
        return -1.0, 1.0
    first, second = (both + first_alone) / pairs, (both + second_alone) / pairs
    low, high = wilson_interval(both + first_alone, pairs)
    other_low, other_high = wilson_interval(both + second_alone, pairs)
    phi = _phi(both, first_alone, second_alone, none)
    difference = first - second
    return (
        difference - _joined(first - low, other_high - second, phi),
        difference + _joined(high - first, second - other_low, phi),
    )


def _phi(both: int, first_alone: int, second_alone: int, none: int) -> float:
    """Return how much two paired shares go with each other, -1 to 1, corrected for few pairs."""
    spread = (
        (both + first_alone) * (second_alone + none) * (both + second_alone) * (first_alone + none)
    )
    if not spread:
        return 0.0
    product = both * none - first_alone * second_alone
    pairs = both + first_alone + second_alone + none
    corrected = max(product - pairs / 2, 0.0) if product > 0 else float(product)
    return corrected / math.sqrt(spread)


def _joined(one: float, other: float, phi: float) -> float:
    return math.sqrt(max(0.0, one * one - 2 * phi * one * other + other * other))
