"""What the rows tell of causes and tries, and which causes the world's log shows to last."""
from smach_oracle.analysis.lasting.causes_log import LoggedCause, causes_in, causes_of, causes_text
from smach_oracle.analysis.lasting.tries import (
    StateTry,
    WorldClock,
    in_world_time,
    tries_in,
    tries_of,
    tries_text,
)
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind


def events_of(*told):
    """Events of one trial: kind, state, and other fields."""
    return [Event(kind, 'x', number, 0.0, 'TOP', state, **more)
            for number, (kind, state, more) in enumerate(told)]


def test_tries_are_those_of_states_that_failed_with_the_restarts_before():
    events = events_of(
        (EventKind.STATE_START, 'LOOK', {}), (EventKind.STATE_START, 'PICK', {}),
        (EventKind.FAILURE, 'PICK', {}), (EventKind.DECISION, 'PICK', {'outcome': 'revisit'}),
        (EventKind.JUMP, 'PICK', {}), (EventKind.STATE_START, 'PICK', {}),
        (EventKind.FAILURE, 'PICK', {}), (EventKind.DECISION, 'PICK', {'outcome': 'restart'}),
        (EventKind.JUMP, 'PICK', {}), (EventKind.STATE_START, 'LOOK', {}),
        (EventKind.STATE_START, 'PICK', {}),
        (EventKind.FAILURE, 'PICK', {'failure_kind': FailureKind.INTERRUPTED}))
    stamps = [float(10 * number) for number in range(len(events))]
    assert tries_of(events, stamps) == [
        ('PICK', 10.0, 20.0, 0), ('PICK', 50.0, 60.0, 0), ('PICK', 100.0, None, 1)]
    assert tries_of(events[::-1], stamps[::-1]) == tries_of(events, stamps), 'in any order'
    assert tries_of(events[:2], stamps) == []


def test_a_state_of_a_container_below_is_named_by_its_path():
    events = events_of((EventKind.TRIAL_START, '', {}), (EventKind.STATE_START, 'A', {}),
                       (EventKind.FAILURE, 'A', {}))
    below = [event._replace(path='TOP/SUB') if event.state else event for event in events]
    assert [each.state for each in tries_of(below, [0.0, 1.0, 2.0])] == ['SUB/A']


def test_times_of_the_clock_are_told_in_the_worlds_time():
    clock = WorldClock(100.0, ((105.0, 10.0), (120.0, 1.0)))
    assert [clock.world_s(second) for second in (99.0, 100.0, 104.0, 110.0, 116.0, 121.5)] == [
        0.0, 0.0, 4.0, 5.0, 6.0, 10.5]
    assert in_world_time([StateTry('PICK', 104.0, 116.0, 0), StateTry('PICK', 121.5, None, 1)],
                         clock) == [('PICK', 4.0, 6.0, 0), ('PICK', 10.5, None, 1)]


def test_causes_and_tries_come_back_as_they_stand_in_a_row():
    causes = [LoggedCause('glare', True, 4.2, None), LoggedCause('reflex', False, None, None)]
    assert causes_in(causes_text(causes)) == causes
    assert causes_text(causes[:1]) == '[["glare",true,4.2,null]]'
    tries = [StateTry('PICK', 1.5, 3.0, 0), StateTry('PICK', 9.0, None, 1)]
    assert tries_in(tries_text(tries)) == tries and tries_in('[]') == []


def test_causes_without_times_are_not_known():
    assert causes_of([{'kind': 'glare', 'text': 't'}]) is None and causes_of(None) is None
    assert causes_of([]) == []
    assert causes_of([{'kind': 'glare', 'text': 't', 'lasting': True, 'began_s': 1,
                       'ended_s': None}]) == [('glare', True, 1, None)]
