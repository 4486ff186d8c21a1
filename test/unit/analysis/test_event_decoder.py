"""Events that are decoded where they stand, beside the same events decoded field by field."""

import io

import genpy
import pytest
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Header

from smach_oracle.analysis.bag_events import EVENT_TYPE, _decoder_of
from smach_oracle.analysis.plain_bags import event_decoder
from smach_oracle.analysis.plain_bags.decoding import MessageDecoder
from smach_oracle.analysis.plain_bags.event_decoder import EventDecoder
from smach_oracle.analysis.plain_bags.indexed_bag import NotPlain, PlainConnection
from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.records.events import Event

TEXT = OracleEvent._full_text
FIELDS = MessageDecoder(TEXT)
AROUND = b'around'

few_texts = st.sampled_from(['', 'a', 'ab', 'ü', 'TOP'])
seconds, nanoseconds = st.integers(0, 2**32 - 1), st.integers(0, 10**9 - 1)
messages = st.builds(
    OracleEvent,
    kind=st.integers(0, 40),
    header=st.builds(Header, seconds, st.builds(genpy.Time, seconds, nanoseconds), few_texts),
    wall_time=st.floats(0, 1e10),
    trial_id=few_texts,
    seq=st.integers(0, 2**64 - 1),
    path=few_texts,
    state=few_texts,
    outcome=few_texts,
    target=few_texts,
    failure_kind=st.integers(0, 8),
    rate=st.floats(0, 1),
    continuous=st.booleans(),
    text=few_texts,
    data=st.sampled_from(['', '{"a": 1}', '{"a": 1.0}', '{"a": true}', 'null']),
)


def bytes_of(message):
    target = io.BytesIO()
    message.serialize(target)
    return target.getvalue()


def decoded(decode, data):
    return decode(AROUND + data + AROUND, len(AROUND), len(AROUND) + len(data))


def field_by_field(data):
    told = dict(zip(FIELDS.names, FIELDS(data)))
    numbers = told['header.stamp.sec'], told['header.stamp.nanosec'], told['kind']
    first = told['trial_id'], told['seq'], told['wall_time']
    return event_decoder.event_of(*numbers, *first, *(told[name] for name in Event._fields[4:]))


@given(st.lists(messages, max_size=8), st.integers(1, 3))
def test_events_are_the_same_in_whatever_order_they_come(found, most):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(event_decoder, '_MOST_REMEMBERED', most)
        decode = EventDecoder(TEXT)
        for message in found + found[::-1]:
            data = bytes_of(message)
            assert repr(decoded(decode, data)) == repr(field_by_field(data))


@given(messages, messages, st.data())
def test_a_message_that_is_cut_off_or_longer_is_refused(before, message, drawn):
    decode = EventDecoder(TEXT)
    decoded(decode, bytes_of(before))
    data = bytes_of(message)
    for part in (data[: drawn.draw(st.integers(0, len(data) - 1))], data + b'\0'):
        with pytest.raises(NotPlain):
            decode(part, 0, len(part))
        with pytest.raises(NotPlain):
            decoded(decode, part)


def test_the_end_of_an_event_is_decoded_once(monkeypatch):
    decode, data, calls = EventDecoder(TEXT), bytes_of(OracleEvent(path='TOP', data='{}')), []
    real = event_decoder.json.loads
    monkeypatch.setattr(event_decoder.json, 'loads', lambda text: calls.append(text) or real(text))
    assert decoded(decode, data) == decoded(decode, data)
    assert calls == ['{}']


def test_a_text_that_is_no_json_is_no_event():
    with pytest.raises(ValueError):
        decoded(EventDecoder(TEXT), bytes_of(OracleEvent(data='{')))


@pytest.mark.parametrize(
    ('line', 'other', 'why'),
    [
        ('string state ', 'string other ', 'no field state'),
        ('string state ', 'string[] state ', ''),
        ('uint8 kind ', 'string path\nuint8 kind ', 'another order'),
        ('uint8 kind ', 'string[] more\nuint8 kind ', 'another order'),
        ('bool continuous', 'time continuous', 'type time'),
    ],
)
def test_other_definitions_are_decoded_otherwise(line, other, why):
    definition = TEXT.replace(line, other)
    assert definition != TEXT
    if not why:
        EventDecoder(definition)
        return
    with pytest.raises(NotPlain, match=why):
        EventDecoder(definition)


def test_fields_in_another_order_are_taken_by_their_names():
    definition = TEXT.replace('uint8 kind ', 'string[] more\nuint8 kind ')
    connection = PlainConnection(0, '/oracle/events', EVENT_TYPE, definition, '')
    data = bytes_of(OracleEvent(kind=5, trial_id='t', path='TOP', data='{"a": 1}'))
    with_more = bytes(4) + data
    assert repr(_decoder_of(connection)(with_more, 0, len(with_more))) == repr(field_by_field(data))
