"""What is counted of one trial, event by event (doc/statistics.md)."""

import pytest

from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.oracle.settings.failure_rule import FailureRule
from smach_oracle.trial_counter import TrialCounter, TrialEnding

STATE, END = EventKind.STATE_START, EventKind.TRIAL_END


def counted(*steps, first=0, rule=None):
    """Count steps (kind, fields), a second apart from 100 s on. A `seq` numbers from there."""
    counter, seq = TrialCounter(rule), first
    for moment, (kind, fields) in enumerate(steps):
        seq = fields.pop('seq', seq)
        place = dict({'path': 'TASK', 'state': 'PICK', 'wall_time': 100.0 + moment}, **fields)
        counter.add(Event(kind, 't', seq, place.pop('wall_time'), place.pop('path'), **place))
        seq += 1
    return counter


def step(kind, **fields):
    return kind, fields


def test_a_trial_is_known_by_its_first_event_and_lasts_from_the_first_to_the_last():
    counter = counted(step(STATE, path='/TASK/IN'), step(STATE, wall_time=99.0), step(END))
    assert (counter.trial_id, counter.experiment) == ('t', 'TASK')
    assert (counter.start_time, counter.duration_s) == (100.0, 3.0)
    assert (counter.last_seq, counter.lost_events, counter.resumed) == (2, 0, 0)
    assert counter.recovers is None and counter.settings == counter.origin == counter.inputs == ()


def test_its_start_says_with_what_it_ran():
    data = {'recovers': False, 'settings': {'b': 1, 'a': 2}, 'origin': {'host': 1}, 'inputs': {}}
    counter = counted(step(EventKind.TRIAL_START, data=data), step(EventKind.DECISION))
    assert counter.recovers is False
    assert counter.settings == (('a', 2), ('b', 1)) and counter.origin == (('host', '1'),)
    assert counted(step(EventKind.DECISION)).recovers is True


def test_failures_are_counted_by_state_but_for_those_of_a_program_that_was_stopped():
    fail = EventKind.FAILURE
    stopped = int(FailureKind.INTERRUPTED)
    counter = counted(
        step(fail), step(fail, state='A'), step(fail), step(fail, failure_kind=stopped)
    )
    assert counter.failures == 3
    assert counter.failures_by_state == (('TASK/A', 1), ('TASK/PICK', 2))


def test_questions_count_once_and_answers_only_of_those_that_were_asked():
    asked, answered = EventKind.QUERY_OPENED, EventKind.QUERY_ANSWERED
    counter = counted(
        step(asked, query_id='1'),
        step(asked, query_id='1'),
        step(asked, query_id='2'),
        step(answered, query_id='2'),
        step(answered, query_id='3'),
    )
    assert (counter.questions, counter.answered) == (2, 1)


DECIDED, JUMP = EventKind.DECISION, EventKind.JUMP


@pytest.mark.parametrize(
    'steps, recoveries',
    [
        ([step(DECIDED, outcome='revisit'), step(JUMP)], 1),
        ([step(DECIDED, outcome='step_back'), step(JUMP), step(JUMP)], 1),
        ([step(DECIDED, outcome='restart'), step(JUMP, path='OTHER')], 0),
        ([step(DECIDED, outcome='ask'), step(JUMP)], 0),
        ([step(DECIDED, outcome='revisit'), step(EventKind.QUERY_OPENED), step(JUMP)], 0),
        ([step(DECIDED, outcome='revisit'), step(EventKind.FAILURE), step(JUMP)], 0),
        ([step(DECIDED, outcome='revisit'), step(EventKind.GIVE_UP), step(JUMP)], 0),
        (
            [
                step(DECIDED, path='TASK/IN', outcome='revisit'),
                step(JUMP, data={'from': 'TASK/IN/PICK'}),
            ],
            1,
        ),
        (
            [
                step(DECIDED, outcome='revisit'),
                step(EventKind.FAILURE, state='B'),
                step(DECIDED, state='B', outcome='revisit'),
                step(JUMP),
                step(JUMP, state='B'),
            ],
            2,
        ),
        (
            [
                step(DECIDED, outcome='revisit'),
                step(DECIDED, state='B', outcome='ask'),
                step(EventKind.QUERY_OPENED, state='B'),
                step(JUMP),
            ],
            1,
        ),
        ([step(DECIDED, outcome='revisit'), step(JUMP, state='B'), step(EventKind.GIVE_UP)], 0),
    ],
)
def test_a_recovery_is_a_decision_of_the_oracle_that_is_carried_out(steps, recoveries):
    copies = [(kind, dict(fields)) for kind, fields in steps]
    assert counted(*copies).recoveries == recoveries


def test_waits_until_the_robot_is_well_are_summed_up():
    begin, end = EventKind.HEALTH_WAIT_START, EventKind.HEALTH_WAIT_END
    counter = counted(step(end), step(begin), step(end, wall_time=104.5), step(begin), step(end))
    assert counter.unwell_s == 3.5 + 1.0


@pytest.mark.parametrize(
    'end, rule, ending',
    [
        ({'outcome': 'succeeded'}, FailureRule(), TrialEnding.SUCCESS),
        ({'outcome': 'aborted'}, FailureRule(), TrialEnding.FAILURE),
        ({'outcome': 'preempted'}, FailureRule(), TrialEnding.PREEMPTED),
        ({'outcome': 'parked'}, FailureRule(), TrialEnding.OTHER),
        ({'outcome': 'parked'}, FailureRule(('parked',)), TrialEnding.FAILURE),
        ({'data': {'ended_by': 'error'}}, None, TrialEnding.FAILURE),
        ({'data': {'ended_by': 'stopped'}}, None, TrialEnding.PREEMPTED),
        ({'data': {'ended_by': 'shutdown'}}, None, TrialEnding.PREEMPTED),
        ({'data': {'ended_by': 'kept'}}, None, TrialEnding.UNFINISHED),
    ],
)
def test_how_a_trial_ended(end, rule, ending):
    counter = counted(step(STATE), step(END, **end), rule=rule)
    assert (counter.ending, counter.outcome) == (ending, end.get('outcome', ''))
    assert counted(step(STATE)).ending is TrialEnding.UNFINISHED


def test_the_rule_is_the_one_that_the_record_names():
    listed = FailureRule(('parked',))
    start = step(EventKind.TRIAL_START, data={'failure_rule': listed.as_data()})
    assert counted(start).rule == listed


def test_events_that_are_missing_are_counted():
    assert counted(step(STATE), step(STATE, seq=5), first=3).lost_events == 4


def test_a_trial_that_goes_on_has_not_ended_and_its_time_down_is_told():
    counter = counted(
        step(STATE),
        step(END, data={'ended_by': 'kept'}),
        step(
            EventKind.RESUMED,
            seq=9,
            wall_time=150.0,
            data={'last_seq': 1, 'stopped_s': 40.0, 'moment': 1},
        ),
    )
    assert (counter.resumed, counter.down_s, counter.ending) == (1, 40.0, TrialEnding.UNFINISHED)
    assert counter.lost_events == 0, 'numbers that no event had'
