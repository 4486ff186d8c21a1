"""The learned failure rates after each trial: as recorded, else as an estimator has them."""

import pytest
from failing_machines import run

from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.reporting.drawn import rate_charts
from smach_oracle.analysis.reporting.learned_rates import Bands, bands_of, learned_rates
from smach_oracle.oracle.records.events import EventKind


def rates_of(trials, **changed):
    return learned_rates(trials, dict(dict(summarise(trials[0]).settings), **changed))


def without_end(trials):
    return [[each for each in trial if each.kind != EventKind.TRIAL_END] for trial in trials]


@pytest.fixture(scope='module')
def trials():
    return run(12)


def test_the_rates_are_those_that_the_oracle_had(trials):
    rates = rates_of(trials)
    assert rates.trials == 12 and not rates.has_gaps and not rates.settings_differ
    names = [each.state for each in rates.states]
    assert {'TOP/PICK', 'TOP/LOOK', 'TOP/PLACE'} <= set(names)
    assert [each.failures for each in rates.states] == sorted(
        (each.failures for each in rates.states), reverse=True
    )
    for each in rates.states:
        assert [number for number, _ in each.points][-1] == 12
        assert all(0.0 <= rate <= 1.0 for _, rate in each.points)
    # the rate at a trial's first failure is the one after the trial before it
    pick = dict(next(each.points for each in rates.states if each.state == 'TOP/PICK'))
    for number, trial in enumerate(trials[1:], 2):
        failed = [e for e in trial if e.kind == EventKind.FAILURE and e.state == 'PICK']
        started = [e for e in trial if e.kind == EventKind.STATE_START and e.state == 'PICK']
        if failed and failed[0].seq < [*started[1:], failed[0]._replace(seq=10**9)][0].seq:
            assert failed[0].rate == pytest.approx(pick[number - 1])


def test_what_the_end_tells_and_what_is_reproduced_is_the_same(trials):
    told, replayed = rates_of(trials), rates_of(without_end(trials))
    assert not replayed.has_gaps
    assert {each.state: dict(each.points)[12] for each in replayed.states} == pytest.approx(
        {each.state: dict(each.points)[12] for each in told.states}
    )


def test_a_program_that_was_started_again_without_its_rates_is_noticed(trials):
    again = [
        [each._replace(wall_time=each.wall_time + 1000.0) for each in trial] for trial in trials
    ]
    rates = rates_of(without_end(trials + again))
    assert not rates.has_gaps and rates.trials == 24
    for each in rates.states:
        points = dict(each.points)
        assert points[24] == pytest.approx(points[12])


def test_where_neither_is_there_the_recorded_rates_are_taken(trials):
    rates = rates_of(without_end(trials), memory=3)
    assert rates.has_gaps
    recorded = {
        (number, event.rate)
        for number, trial in enumerate(trials, 1)
        for event in trial
        if event.kind == EventKind.DECISION and event.state == 'PICK'
    }
    (pick,) = [each for each in rates.states if each.state == 'TOP/PICK']
    assert set(pick.points) & recorded


def test_settings_that_are_not_told_make_no_rates_up(trials):
    assert learned_rates(without_end(trials), {}).bands is None
    assert learned_rates([], {}) is None
    assert bands_of({'moderate_from': 0.4}) is None
    assert bands_of({'moderate_from': 0.4, 'high_from': 'x'}) is None
    assert bands_of({'moderate_from': 0.4, 'high_from': 0.75}) == Bands(0.4, 0.75)
    assert [Bands(0.4, 0.75).class_of(rate) for rate in (0.0, 0.4, 0.75)] == [
        'LOW',
        'MODERATE',
        'HIGH',
    ]


def test_states_with_settings_of_their_own_are_noticed(trials):
    assert rates_of(trials, moderate_from=0.01, high_from=0.02).settings_differ


@pytest.mark.parametrize('data', [None, 'x', {'learned': 3}, {'learned': {'': {'PICK': 'x'}}}])
def test_an_end_that_is_no_record_of_rates_is_passed_over(trials, data):
    broken = [
        [each._replace(data=data) if each.kind == EventKind.TRIAL_END else each for each in trial]
        for trial in trials
    ]
    assert rates_of(broken).states == rates_of(without_end(trials)).states


def test_a_chart_has_a_zone_for_each_class(trials):
    charts = rate_charts(rates_of(trials), 2)
    assert [each.state for each in charts] == [each.state for each in rates_of(trials).states[:2]]
    zones = charts[0].chart.zones
    assert [zone.name for zone in zones] == ['LOW', 'MODERATE', 'HIGH']
    assert all(one.y == pytest.approx(two.y + two.height) for one, two in zip(zones, zones[1:]))
