"""The log of causes and the tries in the rows, and which causes the log shows to last."""

import pytest

from smach_oracle.analysis.comparison import by_variant
from smach_oracle.analysis.drawing.cause_tables import by_cause, by_class, by_log
from smach_oracle.analysis.lasting.causes_log import LoggedCause, causes_in, causes_of, causes_text
from smach_oracle.analysis.lasting.checks import check_of
from smach_oracle.analysis.lasting.tries import (
    StateTry,
    WorldClock,
    in_world_time,
    tries_in,
    tries_of,
    tries_text,
)
from smach_oracle.analysis.trial_rows import TrialRow
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind


def events_of(*told):
    """Events of one trial: kind, state, and other fields."""
    return [
        Event(kind, 'x', number, 0.0, 'TOP', state, **more)
        for number, (kind, state, more) in enumerate(told)
    ]


def test_tries_are_those_of_states_that_failed_with_the_restarts_before():
    events = events_of(
        (EventKind.STATE_START, 'LOOK', {}),
        (EventKind.STATE_START, 'PICK', {}),
        (EventKind.FAILURE, 'PICK', {}),
        (EventKind.DECISION, 'PICK', {'outcome': 'revisit'}),
        (EventKind.JUMP, 'PICK', {}),
        (EventKind.STATE_START, 'PICK', {}),
        (EventKind.FAILURE, 'PICK', {}),
        (EventKind.DECISION, 'PICK', {'outcome': 'restart'}),
        (EventKind.JUMP, 'PICK', {}),
        (EventKind.STATE_START, 'LOOK', {}),
        (EventKind.STATE_START, 'PICK', {}),
        (EventKind.FAILURE, 'PICK', {'failure_kind': FailureKind.INTERRUPTED}),
    )
    stamps = [float(10 * number) for number in range(len(events))]
    assert tries_of(events, stamps) == [
        ('PICK', 10.0, 20.0, 0),
        ('PICK', 50.0, 60.0, 0),
        ('PICK', 100.0, None, 1),
    ]
    assert tries_of(events[::-1], stamps[::-1]) == tries_of(events, stamps), 'in any order'
    assert tries_of(events[:2], stamps) == []


def test_a_state_of_a_container_below_is_named_by_its_path():
    events = events_of(
        (EventKind.TRIAL_START, '', {}),
        (EventKind.STATE_START, 'A', {}),
        (EventKind.FAILURE, 'A', {}),
    )
    below = [event._replace(path='TOP/SUB') if event.state else event for event in events]
    assert [each.state for each in tries_of(below, [0.0, 1.0, 2.0])] == ['SUB/A']


def test_times_of_the_clock_are_told_in_the_worlds_time():
    clock = WorldClock(100.0, ((105.0, 10.0), (120.0, 1.0)))
    assert [clock.world_s(second) for second in (99.0, 100.0, 104.0, 110.0, 116.0, 121.5)] == [
        0.0,
        0.0,
        4.0,
        5.0,
        6.0,
        10.5,
    ]
    assert in_world_time(
        [StateTry('PICK', 104.0, 116.0, 0), StateTry('PICK', 121.5, None, 1)], clock
    ) == [('PICK', 4.0, 6.0, 0), ('PICK', 10.5, None, 1)]


def test_causes_and_tries_come_back_as_they_stand_in_a_row():
    causes = [LoggedCause('glare', True, 4.2, None), LoggedCause('reflex', False, None, None)]
    assert causes_in(causes_text(causes)) == causes
    assert causes_text(causes[:1]) == '[["glare",true,4.2,null]]'
    tries = [StateTry('PICK', 1.5, 3.0, 0), StateTry('PICK', 9.0, None, 1)]
    assert tries_in(tries_text(tries)) == tries and tries_in('[]') == []


def test_causes_without_times_are_not_known():
    assert causes_of([{'kind': 'glare', 'text': 't'}]) is None and causes_of(None) is None
    assert causes_of([]) == []
    assert causes_of(
        [{'kind': 'glare', 'text': 't', 'lasting': True, 'began_s': 1, 'ended_s': None}]
    ) == [('glare', True, 1, None)]


def row(tries, causes, **more):
    """A trial with causes: kind, whether it lasts by its class, begin and end."""
    return TrialRow(
        'pick_and_place',
        'restart',
        0,
        7,
        'success',
        failures=len(tries),
        causes=' '.join(each[0] for each in causes),
        tries=tries_text(tries),
        cause_log=causes_text([LoggedCause(*each) for each in causes]),
        **more,
    )


GLARE, REFLEX = ('glare', True, 0.0, None), ('reflex', False, 9.0, 14.0)
FAILED = StateTry('LOOK', 8.0, 10.0, 0)


@pytest.mark.parametrize(
    'tries, at_second_try, after_restart, by_log',
    [
        ([], None, None, None),
        ([FAILED], None, None, None),  # the bare script
        ([FAILED, StateTry('LOOK', 11.0, None, 0)], {'glare', 'reflex'}, None, None),
        ([FAILED, StateTry('LOOK', 20.0, None, 1)], {'glare'}, {'glare'}, {'glare'}),
        (
            [FAILED, StateTry('LOOK', 11.0, 12.0, 0), StateTry('LOOK', 20.0, None, 1)],
            {'glare', 'reflex'},
            {'glare'},
            {'glare'},
        ),
        ([FAILED, StateTry('PICK', 12.0, 13.0, 1)], None, None, None),
    ],
)  # another state
def test_a_cause_lasts_that_is_there_at_the_second_try_and_after_a_restart(
    tries, at_second_try, after_restart, by_log
):
    check = check_of(row(tries, [GLARE, REFLEX]))
    assert (check.failed, check.at_second_try, check.after_restart) == (
        bool(tries),
        at_second_try,
        after_restart,
    )
    assert check.lasting_by_class == {'glare'} and check.lasting_by_log == by_log


def test_a_cause_about_which_something_was_done_does_not_last_in_that_trial():
    check = check_of(
        row([FAILED, StateTry('LOOK', 20.0, None, 1)], [('goal_occupied', True, 0.0, 15.0)])
    )
    assert check.lasting_by_class and check.lasting_by_log == frozenset()


def test_a_cause_whose_end_the_log_never_tells_is_not_shown_to_last():
    tries = [FAILED, StateTry('LOOK', 20.0, None, 1)]
    assert check_of(row(tries, [('base_misplaced', True, 0.0, None)])).lasting_by_log == frozenset()
    assert check_of(row(tries, [('base_misplaced', True, 0.0, 30.0)])).lasting_by_log == {
        'base_misplaced'
    }


def test_a_row_of_an_older_version_tells_nothing():
    assert check_of(TrialRow('pick_and_place', 'restart', 0, 7, 'success', causes='glare')) is None


def test_the_tables_tell_the_shares_by_class_and_by_the_log():
    again = StateTry('LOOK', 20.0, None, 1)
    rows = [
        row([FAILED, again], [GLARE]),
        row([FAILED, again], [REFLEX]),
        row([FAILED, again], [('crowded', True, 0.0, 15.0)]),
        row([], [GLARE]),
        row([FAILED], [('dim_light', True, 0.0, None)]),
        row([], []),
        row([FAILED], []),
    ]
    rows += [row([FAILED, StateTry('LOOK', 11.0, None, 0)], [REFLEX])._replace(variant='retry')]
    (text,) = by_log('Pick and place', by_variant(rows))
    for told in (
        '| glare | lasts | 2 | 1 | 1 of 1 | 0 of 0 |',
        '| reflex | passes | 1 | 1 | 0 of 1 | 1 of 1 |',
        '| crowded | lasts | 1 | 1 | 0 of 1 | 0 of 0 |',
        'have one of a class that lasts: 4 of 5, 80.0%',
        'showed to last at least once: 2 of 5, 40.0%',
        'by class 2 of 3, 66.7%',
        'by the log 1 of 3, 33.3%',
        'Of 1 trials the log cannot say it, as no state',
        'and of 1 as the failed state was not tried',
    ):
        assert told in text
    assert by_log('Pick and place', {'bare': rows}) == []


def test_a_kind_that_the_log_gives_no_end_is_not_told():
    tries = [FAILED, StateTry('LOOK', 20.0, None, 1)]
    (text,) = by_log('Kitchen', by_variant([row(tries, [('base_misplaced', True, 0.0, None)])]))
    assert '| base misplaced | lasts | 1 | 1 | not told | not told |' in text
    assert 'at least once: 0 of 1' in text and 'The log gives no end to base misplaced' in text


def test_interventions_stand_beside_each_other_by_class_and_cause():
    causes = [[], [GLARE], [REFLEX], [GLARE, REFLEX]]
    rows = [
        row(
            [],
            each,
            questions=int(variant == 'restart' and bool(each)),
            lasting=sum(cause[1] for cause in each),
            true_success=variant != 'bare',
        )._replace(variant=variant, seed=seed)
        for variant in ('bare', 'default', 'restart')
        for seed, each in enumerate(causes)
    ]
    (text,) = by_class('Pick and place', by_variant(rows + [rows[0]._replace(seed=9)]))
    for told in (
        '| no listed cause | 1 | 1 (100%) | 0 (0%) | 0 (0%) |',
        '| passing causes alone | 1 | 1 (100%) | 0 (0%) | 1 (100%) |',
        '| a lasting cause | 2 | 2 (100%) | 0 (0%) | 2 (100%) |',
        '| with reflex | 2 | 2 (100%) | 0 (0%) | 2 (100%) |',
        '| all | 4 | 4 (100%) | 0 (0%) | 3 (75%) |',
        'The 4 trials that',
    ):
        assert told in text
    assert by_class('Pick and place', {'bare': rows}) == []


def test_failures_without_a_listed_cause_have_a_line_with_an_interval():
    rows = [
        row([FAILED], [GLARE], questions=1),
        row([], [GLARE, REFLEX]),
        row([FAILED], []),
        row([], []),
        row([], []),
    ]
    (text,) = by_cause('Pick and place', by_variant(rows))
    assert '| glare | lasts | 2 | 1 | 1 | 2 |' in text
    assert '| reflex | passes | 1 | 0 | 0 | 1 |' in text
    assert '| none | - | 3 | 1 of 3, 33.3% (6% to 79%) | 0 | 3 |' in text
    older = [each._replace(cause_log='', tries='') for each in rows]
    assert '| glare | - | 2 | 1 | 1 | 2 |' in by_cause('Pick and place', by_variant(older))[0]
