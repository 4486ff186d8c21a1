"""Tests of pairs against published values, and how often they are right in drawn trials."""

import math
import random
from collections import Counter

import pytest

from smach_oracle.analysis.judging.paired_tests import (
    ONE_SIDED,
    costs_less,
    less_than_a_part,
    needs_more,
    normal_tail,
    not_worse,
    power_where_equal,
    ratio_interval,
    tango_interval,
    tango_z,
)
from smach_oracle.analysis.pairing import PairedCounts

# Fagerland, Lydersen and Laake, Stat. Med. 33 (2014) p. 2850: the data of Bentur et al. and of Cavo
# et al., and the score intervals of Tango and of Tang, Tang and Chan for them
BENTUR, CAVO = PairedCounts(1, 1, 7, 12), PairedCounts(59, 6, 16, 80)


@pytest.mark.parametrize(
    'counts, difference, ratio',
    [
        (BENTUR, (-0.517, -0.026), (0.065, 0.907)),
        (CAVO, (-0.124, -0.005), (0.748, 0.988)),
    ],
)
def test_the_score_intervals_are_those_that_were_published(counts, difference, ratio):
    pairs = sum(counts)
    found = tango_interval(counts.first_alone, counts.second_alone, pairs)
    assert tuple(round(each, 3) for each in found) == difference
    assert tuple(round(each, 3) for each in ratio_interval(counts)) == ratio


def test_the_test_of_a_margin_is_the_one_of_tangos_paper():
    # T. Tango, Stat. Med. 17 (1998), the first example: two ways to disinfect soft contact lenses,
    # 43 pairs in which both work and one in which only the second does, and a margin of 0.1
    z = tango_z(0, 1, 44, -0.1)
    assert round(z, 3) == 1.709 and round(normal_tail(-z), 3) == 0.044
    # what works is a thing that is good. What does not work, counted as bad, is the same test
    assert not_worse(PairedCounts(0, 1, 0, 43), 0.1) == pytest.approx(normal_tail(-z))


def test_at_no_difference_the_test_is_mcnemars():
    assert tango_z(7, 1, 21, 0.0) == pytest.approx((7 - 1) / math.sqrt(7 + 1))


@pytest.mark.parametrize(
    'counts', [BENTUR, CAVO, PairedCounts(3, 0, 9, 40), PairedCounts(0, 0, 8, 9)]
)
def test_a_test_rejects_where_its_interval_leaves_the_value_out(counts):
    pairs = sum(counts)
    _, high = tango_interval(counts.first_alone, counts.second_alone, pairs)
    assert not_worse(counts, high + 1e-6) < ONE_SIDED < not_worse(counts, high - 1e-6)
    _, high = ratio_interval(counts)
    assert less_than_a_part(counts, high + 1e-6) < ONE_SIDED
    assert less_than_a_part(counts, high - 1e-6) > ONE_SIDED


@pytest.mark.parametrize('counts', [PairedCounts(0, 0, 0, 0), PairedCounts(0, 0, 0, 450)])
def test_without_anything_that_happened_half_as_often_is_not_shown(counts):
    assert less_than_a_part(counts, 0.5) >= 0.5


def test_what_is_no_count_of_pairs_is_refused():
    for wrong in ((-1, 0, 5, 0.0), (3, 3, 5, 0.0), (0, 0, 0, 0.0), (1, 1, 5, 1.0)):
        with pytest.raises(ValueError, match='not allowed'):
            tango_z(*wrong)


# eighths of an inch by which crossed plants of maize are higher than self-fertilised ones: C.
# Darwin, 1876. R. A. Fisher (The Design of Experiments, 1935, section 21) counts 863 of 32,768
# signs whose sum is not below that of the plants
MAIZE = (49, -67, 8, 16, 6, 23, 28, 41, 14, 29, 56, 24, 75, 60, -48)


def test_the_permutation_of_costs_is_fishers():
    found = costs_less([0] * len(MAIZE), MAIZE)
    assert found.p_value == 863 / 32768 and found.exact
    assert found.mean == pytest.approx(-sum(MAIZE) / 15)


def test_drawn_signs_give_about_what_all_signs_give_and_the_seed_draws_them():
    again = [*MAIZE, *MAIZE[:6]]
    drawn = costs_less([0] * len(again), again, seed=1)
    sums = Counter({0: 1})  # of all signs
    for each in again:
        sums = Counter(
            {place: sums[place - each] + sums[place + each] for place in _around(sums, each)}
        )
    below = sum(count for place, count in sums.items() if place >= sum(again))
    assert not drawn.exact and drawn == costs_less([0] * len(again), again, seed=1)
    assert drawn.p_value == pytest.approx(below / 2 ** len(again), abs=0.0015)


def _around(sums, distance):
    return {place + sign * distance for place in sums for sign in (1, -1)}


def test_pairs_without_a_difference_say_nothing():
    assert costs_less([1, 2], [1, 2]).p_value == 1.0 and costs_less([], []).p_value == 1.0
    assert costs_less([0, 5], [3, 5]).p_value == 0.5
    assert costs_less([0.1] * 3, [0.3] * 3).p_value == 1 / 8


# -- how often the tests are right: the claims of doc/protocol.md about the number of pairs


def drawn(rng, pairs, first_alone, second_alone, both=0.01):
    """Counts of pairs with these chances."""
    found = [0, 0, 0, 0]
    for _ in range(pairs):
        value = rng.random()
        place = (
            0
            if value < both
            else 1
            if value < both + first_alone
            else 2
            if value < both + first_alone + second_alone
            else 3
        )
        found[place] += 1
    return PairedCounts(*found)


def share(rng, test, times=600):
    return sum(test() for _ in range(times)) / times


@pytest.mark.parametrize(
    'pairs, differ, power',
    [(450, 0.05, 0.82), (400, 0.046, 0.80), (1100, 0.126, 0.80), (450, 0.10, 0.52)],
)
def test_the_power_where_both_are_equal_is_what_the_protocol_says(pairs, differ, power):
    rng = random.Random('equal {}'.format(pairs))
    assert power_where_equal(round(differ * pairs), pairs, 0.03) == pytest.approx(power, abs=0.02)
    found = share(rng, lambda: not_worse(drawn(rng, pairs, differ / 2, differ / 2), 0.03) <= 0.025)
    assert found == pytest.approx(power, abs=0.06)


def test_where_the_first_is_worse_by_one_point_the_power_is_far_below():
    rng = random.Random('worse')
    found = share(rng, lambda: not_worse(drawn(rng, 450, 0.03, 0.02), 0.03) <= 0.025)
    assert 0.35 < found < 0.6


@pytest.mark.parametrize('pairs', [450, 400])
def test_a_quarter_of_the_questions_is_shown_and_half_of_them_is_not(pairs):
    rng = random.Random('half {}'.format(pairs))
    # 15% under the second, of which one in three also under the first
    assert (
        share(rng, lambda: less_than_a_part(drawn(rng, pairs, 0.01, 0.12, 0.03), 0.5) <= 0.025)
        > 0.85
    )
    assert (
        share(rng, lambda: less_than_a_part(drawn(rng, pairs, 0.025, 0.1, 0.05), 0.5) <= 0.025)
        < 0.05
    )


def test_the_extension_by_what_differs_alone_does_not_let_more_through():
    rng = random.Random('extension')

    def rejects():
        counts = drawn(rng, 450, 0.06, 0.03)  # worse by just the margin
        if needs_more(counts.first_alone + counts.second_alone, 450, 0.03):
            more = drawn(rng, 650, 0.06, 0.03)
            counts = PairedCounts(*(one + other for one, other in zip(counts, more)))
        return not_worse(counts, 0.03) <= 0.025

    assert share(rng, rejects, 1500) < 0.037  # 0.025, and three standard errors of the simulation
