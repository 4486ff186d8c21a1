"""Tests of shares between two groups of trials, which pair by seed or inputs. Pure."""

import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from ..counting.trial_summary import TrialSummary
from ..intervals import Interval, paired_difference, wilson_interval
from ..pairing import mcnemar_exact
from ..trial_counter import EXPERT_ANSWERED, PERSON_NEEDED, TrialEnding
from .groups import TrialGroup

Happened = Callable[[TrialSummary], Optional[bool]]
# what is tested. None: it is not known of a trial, which is then left out
TESTED: Tuple[Tuple[str, Happened], ...] = (
    ('failures of states', lambda trial: trial.failures > 0),
    (EXPERT_ANSWERED, lambda trial: trial.answered > 0),
    ('ended in failure', lambda trial: trial.ending is TrialEnding.FAILURE),
    ('true success', lambda trial: None if trial.truth is None else trial.truly_succeeded),
    (PERSON_NEEDED, lambda trial: trial.person_needed is True),
)


class ShareTest(NamedTuple):
    """A share of two groups, and how likely so large a difference is by chance."""

    name: str
    first: int
    first_of: int
    second: int
    second_of: int
    difference: float  # of the shares, the first less the second
    interval: Interval  # of 95%, of the difference
    p_value: float  # two-sided
    is_paired: bool  # McNemar's test, else Fisher's
    is_bound: bool = False  # the shares are lower bounds: nobody has judged some trials


class Pairing(NamedTuple):
    """The trials of two groups that did the same, two by two."""

    by: str  # one of PAIRED_BY. '' means that they do not pair
    pairs: List[Tuple[TrialSummary, TrialSummary]]


# what two trials have in common that pair
PAIRED_BY: Tuple[Tuple[str, Callable[[TrialSummary], object]], ...] = (
    ('seed', lambda trial: trial.cause and (trial.cause.seed,)),
    ('inputs', lambda trial: trial.inputs),
)


def fisher_exact(first: int, first_of: int, second: int, second_of: int) -> float:
    """Return the two-sided p-value of Fisher's exact test of two shares.

    It is the chance of all tables with these sums that are no likelier than this one (R. A. Fisher,
    J. R. Stat. Soc. 98, 1935).

    :raises ValueError: unless 0 <= first <= first_of, and so for the second.
    """
    if not (0 <= first <= first_of and 0 <= second <= second_of):
        raise ValueError(
            'counts: {!r} is not allowed; allowed: each 0 to the number of its trials'.format(
                (first, first_of, second, second_of)
            )
        )
    happened = first + second
    ways = [
        math.comb(first_of, count) * math.comb(second_of, happened - count)
        for count in range(max(0, happened - second_of), min(first_of, happened) + 1)
    ]
    own = math.comb(first_of, first) * math.comb(second_of, second)
    return sum(each for each in ways if each <= own) / sum(ways)


def difference_interval(first: int, first_of: int, second: int, second_of: int) -> Interval:
    """Return the 95% interval of the difference of two shares, the first less the second.

    It is Newcombe's of independent shares, from Wilson's intervals of the two (R. G. Newcombe,
    Stat. Med. 17, 1998, p. 873, method 10). (-1, 1) where one has no trials.
    """
    if not first_of or not second_of:
        return -1.0, 1.0
    one, other = first / first_of, second / second_of
    low, high = wilson_interval(first, first_of)
    other_low, other_high = wilson_interval(second, second_of)
    difference = one - other
    return (
        difference - math.hypot(one - low, other_high - other),
        difference + math.hypot(high - one, other - other_low),
    )


def pairing_of(first: TrialGroup, second: TrialGroup) -> Pairing:
    """Return the trials that pair: by the first of PAIRED_BY that each trial has one of its own."""
    for by, key_of in PAIRED_BY:
        one, other = _by_key(first, key_of), _by_key(second, key_of)
        common = one.keys() & other.keys()
        if common:
            return Pairing(by, [(one[key], other[key]) for key in one if key in common])
    return Pairing('', [])


def _by_key(group: TrialGroup, key_of: Callable[[TrialSummary], object]) -> Dict[str, TrialSummary]:
    """Return the trials by their keys. None where one has no key, or two have the same."""
    found = {repr(key): trial for trial in group.trials for key in [key_of(trial)] if key}
    return found if len(found) == len(group.trials) else {}


def share_tests(first: TrialGroup, second: TrialGroup) -> List[ShareTest]:
    """Return a test of each of TESTED that is known of trials of both groups."""
    pairs = pairing_of(first, second).pairs
    tests = []
    for name, happened in TESTED:
        test = (
            _paired(name, happened, pairs)
            if pairs
            else _unpaired(name, happened, first.trials, second.trials)
        )
        if test is not None:
            tests.append(test)
    is_bound = any(trial.person_needed is None for trial in first.trials + second.trials)
    return [test._replace(is_bound=is_bound and test.name == PERSON_NEEDED) for test in tests]


def _paired(
    name: str, happened: Happened, pairs: Sequence[Tuple[TrialSummary, TrialSummary]]
) -> Optional[ShareTest]:
    found = [(happened(one), happened(other)) for one, other in pairs]
    known = [each for each in found if None not in each]
    if not known:
        return None
    both, alone, other_alone, none = (
        known.count(each) for each in ((True, True), (True, False), (False, True), (False, False))
    )
    return ShareTest(
        name,
        both + alone,
        len(known),
        both + other_alone,
        len(known),
        (alone - other_alone) / len(known),
        paired_difference(both, alone, other_alone, none),
        mcnemar_exact(alone, other_alone),
        True,
    )


def _unpaired(
    name: str, happened: Happened, first: Sequence[TrialSummary], second: Sequence[TrialSummary]
) -> Optional[ShareTest]:
    known = [
        [each for each in map(happened, trials) if each is not None] for trials in (first, second)
    ]
    if not all(known):
        return None
    counts = [number for each in known for number in (sum(each), len(each))]
    one, one_of, other, other_of = counts
    return ShareTest(
        name,
        one,
        one_of,
        other,
        other_of,
        one / one_of - other / other_of,
        difference_interval(one, one_of, other, other_of),
        fisher_exact(one, one_of, other, other_of),
        False,
    )
