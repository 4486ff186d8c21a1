"""Events and rates as messages, in a process without a ROS master."""

import io
import json
import math
from typing import NamedTuple

import genpy
import pytest

from smach_oracle.msg import ExpertQueryGoal, OracleEvent
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.ros.event_messages import rates_to_msg, to_msg


class FakeRateRow(NamedTuple):
    path: str = 'TOP'
    state: str = 'PICK'
    rate: float = 0.25
    failure_class: int = 1
    successes: int = 3
    failures: int = 1
    recoveries: int = 2
    has_preconditions: bool = True


class FakeTransitionRow(NamedTuple):
    path: str = 'TOP'
    state: str = 'PICK'
    outcome: str = 'succeeded'
    to: str = 'PLACE'
    count: int = 3


def over_the_wire(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


def test_every_field_of_an_event_arrives():
    event = Event(
        EventKind.FAILURE,
        'trial-1',
        7,
        12.5,
        'TOP/ARM',
        'PICK',
        'aborted',
        'PLACE',
        FailureKind.FELL_THROUGH,
        2,
        0.5,
        True,
        'query-1',
        'Ann',
        'dropped it',
        {'keys': ['a']},
    )
    message = over_the_wire(to_msg(event))
    assert [message.kind, message.wall_time, message.trial_id, message.seq] == [
        OracleEvent.FAILURE,
        12.5,
        'trial-1',
        7,
    ]
    assert [message.path, message.state, message.outcome, message.target] == [
        'TOP/ARM',
        'PICK',
        'aborted',
        'PLACE',
    ]
    assert [message.failure_kind, message.failure_class] == [
        OracleEvent.FELL_THROUGH,
        OracleEvent.MODERATE,
    ]
    assert [message.rate, message.continuous, message.query_id, message.by] == [
        0.5,
        True,
        'query-1',
        'Ann',
    ]
    assert message.text == 'dropped it'
    assert json.loads(message.data) == {'keys': ['a']}


def test_the_kinds_of_the_executive_and_of_the_message_are_the_same():
    for kind in list(EventKind) + list(FailureKind):
        message = OracleEvent if hasattr(OracleEvent, kind.name) else ExpertQueryGoal
        assert getattr(message, kind.name) == kind


def test_an_event_without_a_rate_or_data_says_so():
    message = over_the_wire(to_msg(Event(EventKind.TRIAL_START, 'trial-1', 0, 1.0, 'TOP')))
    assert math.isnan(message.rate) and message.data == ''


def test_without_ros_the_stamp_is_zero_and_a_given_one_is_kept():
    event = Event(EventKind.TRIAL_START, 'trial-1', 0, 1.0, 'TOP')
    assert to_msg(event).header.stamp == genpy.Time(0)
    assert to_msg(event, genpy.Time(3, 5)).header.stamp == genpy.Time(3, 5)


@pytest.mark.parametrize(
    'text, arrives', [('Überlauf – 手', 'Überlauf – 手'), ('half \ud800', 'half \\ud800')]
)
def test_any_text_a_state_may_raise_can_be_sent(text, arrives):
    event = Event(EventKind.FAILURE, 'trial-1', 0, 1.0, 'TOP', text=text)
    assert over_the_wire(to_msg(event)).text == arrives


def test_data_that_json_does_not_know_is_sent_as_its_text():
    event = Event(EventKind.WARNING, 'trial-1', 0, 1.0, 'TOP', data={'why': ValueError('odd')})
    assert json.loads(to_msg(event).data) == {'why': 'odd'}


def test_rates_and_edges_arrive():
    message = over_the_wire(
        rates_to_msg('trial-1', [FakeRateRow(), FakeRateRow(state='PLACE')], [FakeTransitionRow()])
    )
    assert message.trial_id == 'trial-1'
    row, edge = message.states[0], message.transitions[0]
    assert (row.path, row.state, row.rate, row.failure_class) == (
        'TOP',
        'PICK',
        0.25,
        OracleEvent.LOW,
    )
    assert (row.successes, row.failures, row.recoveries, row.has_preconditions) == (3, 1, 2, True)
    assert message.states[1].state == 'PLACE'
    assert (edge.path, edge.state, edge.outcome, edge.target, edge.count) == (
        'TOP',
        'PICK',
        'succeeded',
        'PLACE',
        3,
    )
