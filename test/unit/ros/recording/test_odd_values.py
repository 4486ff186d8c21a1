"""Whatever a value does as it is looked at, it stops no topic and no bag."""

import genpy
import pytest
from geometry_msgs.msg import Point, PointStamped
from hostile_values import Rude, boxed, holding_itself, raising, values
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recorded import events, finished

import smach
from smach_common.introspection.plain_pickle import decode_userdata, encode_userdata
from smach_oracle.msg import UserdataItem
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import Event, EventKind, EventSource
from smach_oracle.ros.event_messages import to_msg
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording.event_packing import serialise
from smach_oracle.ros.stored.ros_codecs import offer_ros_codecs
from smach_oracle.ros.userdata_codec import decode, encode, encode_all
from smach_oracle.store.codecs import OFFERED, Codecs, NotStorable

QUICK = {
    'deadline': None,
    'derandomize': True,
    'database': None,
    'suppress_health_check': list(HealthCheck),
}
wrong_messages = st.one_of(
    st.builds(Point, values, values, values),
    st.builds(PointStamped, values, values),
    st.builds(lambda value: [Point(), Point(1.0, value, 2.0)], values),
)
messages_and_values = st.one_of(values, wrong_messages)


@settings(max_examples=300, **QUICK)
@given(boxed(messages_and_values))
def test_a_value_is_sent_or_named_as_unsent(box):
    (value,) = box
    item = encode('odd', value)
    serialise(item)
    if item.encoding == UserdataItem.UNSENT:
        assert item.type
    else:
        decode(item)


def test_every_other_key_of_a_question_is_sent():
    items = encode_all(
        {'odd': Point(x='left'), 'good': 1, 7: type('Odd', (), {'__str__': raising(Rude)})()}
    )
    assert [(item.key, item.encoding) for item in items] == [
        ('7', UserdataItem.UNSENT),
        ('good', UserdataItem.JSON),
        ('odd', UserdataItem.UNSENT),
    ]


@settings(max_examples=300, **QUICK)
@given(boxed(messages_and_values))
def test_a_value_is_stored_or_refused_with_a_reason(box):
    (value,) = box
    offer_ros_codecs()
    codecs = Codecs(OFFERED)
    try:
        text, whole, parts = codecs.encode(value)
    except NotStorable as err:
        assert str(err)
    else:
        codecs.decode(text, whole, parts.__getitem__)


@settings(max_examples=200, **QUICK)
@given(boxed(messages_and_values))
def test_viewers_get_all_other_keys(box):
    (value,) = box
    left_out = []
    text = encode_userdata({'good': 1, 'odd': value}, lambda key, err: left_out.append(key))
    if left_out:
        assert decode_userdata(text) == {'good': 1}


@settings(max_examples=200, **QUICK)
@given(boxed(values))
def test_an_event_becomes_a_message_whatever_it_holds(box):
    (value,) = box
    event = Event(
        EventKind.WARNING, 't', 0, 0.0, 'TOP', text=value, outcome=value, data={'odd': value}
    )
    assert serialise(to_msg(event, genpy.Time()))


def test_events_behind_one_with_an_odd_value_are_in_the_bag(tmp_path):
    source = EventSource(pytest.fail)
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail)
    recorder.attach(source)
    source.begin_trial('t')
    source.emit(EventKind.TRIAL_START, 'TOP')
    for value in (holding_itself(), {(1, 2): 3}, type('Odd', (), {'__str__': raising(Rude)})()):
        source.emit(EventKind.WARNING, 'TOP', text='odd', data={'odd': value})
    source.emit(EventKind.TRIAL_END, 'TOP', outcome='ok')
    assert recorder.close(10.0)
    assert [event.seq for event in events(finished(tmp_path)[0])] == [0, 1, 2, 3, 4]


class Unspeakable(Exception):
    def __str__(self):
        raise Rude

    __repr__ = __str__


def test_a_failure_that_has_no_text_is_recovered_from_and_recorded(tmp_path):
    tries = iter([1])

    def fails_once(userdata):
        if next(tries, 0):
            raise Unspeakable
        return 'ok'

    machine = smach.StateMachine(['ok', 'aborted'])
    with machine:
        smach.StateMachine.add('A', smach.CBState(fails_once, outcomes=['ok', 'aborted']))
    wrapped = OracleContainer.wrap(machine, name='TOP')
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail)
    recorder.attach(wrapped)
    assert machine.execute() == 'ok'
    assert recorder.close(10.0)
    (failure,) = [
        event for event in events(finished(tmp_path)[0]) if event.kind == EventKind.FAILURE
    ]
    assert failure.text.startswith('Unspeakable: ')
