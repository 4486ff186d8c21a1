"""Survival between interventions: Kaplan and Meier's estimate, and the stretches it is made of."""

import pytest
from test_table import trial

from smach_oracle.analysis.reporting.drawn import survivals
from smach_oracle.analysis.reporting.survival import (
    Duration,
    PersonFree,
    hours_of,
    kaplan_meier,
    median_of,
    stretches,
)
from smach_oracle.analysis.trial_counter import TrialEnding

# the maintained group of Miller's leukaemia data, as in R's survival::aml (weeks, + is censored)
AML = [(9, True), (13, True), (13, False), (18, True), (23, True), (28, False), (31, True)] + [
    (34, True),
    (45, False),
    (48, True),
    (161, False),
]


def test_the_estimate_is_that_of_the_text_book():
    steps = kaplan_meier([Duration(float(length), ended) for length, ended in AML])
    assert [(step.length, step.at_risk, step.ended) for step in steps] == [
        (9, 11, 1),
        (13, 10, 1),
        (18, 8, 1),
        (23, 7, 1),
        (31, 5, 1),
        (34, 4, 1),
        (48, 2, 1),
    ]
    assert [round(step.share, 3) for step in steps] == [
        0.909,
        0.818,
        0.716,
        0.614,
        0.491,
        0.368,
        0.184,
    ]
    # of 95%, on the scale of log(-log)
    assert steps[0].interval == (pytest.approx(0.508, abs=5e-4), pytest.approx(0.987, abs=5e-4))
    assert steps[1].interval == (pytest.approx(0.447, abs=5e-4), pytest.approx(0.951, abs=5e-4))
    assert median_of(steps) == 31


def test_the_interval_lies_around_the_share_and_within_0_and_1():
    steps = kaplan_meier([Duration(float(length), ended) for length, ended in AML])
    for step in steps:
        low, high = step.interval
        assert 0.0 <= low <= step.share <= high <= 1.0


@pytest.mark.parametrize(
    'durations, shares, median',
    [
        ([], [], None),
        ([(3.0, False)], [], None),
        ([(3.0, True)], [0.0], 3.0),
        ([(2.0, True), (2.0, True)], [0.0], 2.0),
        ([(1.0, True), (4.0, False), (4.0, False)], [2 / 3], None),
        ([(1.0, False), (2.0, True)], [0.0], 2.0),
    ],
)
def test_small_numbers_of_stretches(durations, shares, median):
    steps = kaplan_meier([Duration(*each) for each in durations])
    assert [step.share for step in steps] == pytest.approx(shares)
    assert median_of(steps) == median
    assert all(0.0 <= step.interval[0] <= step.interval[1] <= 1.0 for step in steps)


def series(needed, folder='a', duration_s=3600.0):
    return [
        trial(
            number,
            start_time=1000.0 * number,
            duration_s=duration_s,
            bags=('/{}/{}.bag'.format(folder, number),),
            questions=int(bool(asked)),
        )
        if asked is not None
        else trial(
            number,
            start_time=1000.0 * number,
            duration_s=duration_s,
            bags=('/{}/{}.bag'.format(folder, number),),
            ending=TrialEnding.FAILURE,
        )
        for number, asked in enumerate(needed)
    ]


def test_a_stretch_ends_with_the_trial_that_needed_a_person():
    found = stretches(series([False, False, True, False, None, False]))
    assert found == [PersonFree(3, 3.0, True), PersonFree(2, 2.0, True), PersonFree(1, 1.0, False)]


def test_each_folder_begins_a_new_stretch():
    trials = series([False, True], 'b') + series([False], 'a')
    assert stretches(trials) == [PersonFree(1, 1.0, False), PersonFree(2, 2.0, True)]
    assert stretches([]) == []


def test_time_in_which_the_program_did_not_run_is_no_time_of_the_robot():
    (one,) = series([False])
    assert hours_of(one._replace(down_s=1800.0)) == 0.5
    assert hours_of(one._replace(duration_s=float('nan'))) == 0.0


def test_the_charts_tell_the_same_in_trials_and_in_a_unit_that_suits():
    found = survivals(stretches(series([False, True, False, True])))
    assert [(each.unit, each.stretches, each.ended, each.median) for each in found] == [
        ('trials', 2, 2, 2.0),
        ('hours', 2, 2, 2.0),
    ]
    short = survivals(stretches(series([False, True], duration_s=60.0)))
    assert [each.unit for each in short] == ['trials', 'minutes']
    brief = survivals(stretches(series([False, True], duration_s=1.0)))
    assert [each.unit for each in brief] == ['trials', 'seconds']
    assert [each.unit for each in survivals(stretches(series([True], duration_s=0.0)))] == [
        'trials'
    ]
    assert survivals([]) == []


@pytest.mark.parametrize(
    'needed, words',
    [
        ([True, True], 'At most half go on beyond 1 trial'),
        ([False, True], 'At most half go on beyond 2 trials'),
        ([False, False], 'More than half go on beyond all trials that were seen'),
    ],
)
def test_the_median_in_words(needed, words):
    assert survivals(stretches(series(needed)))[0].median_in_words == words
