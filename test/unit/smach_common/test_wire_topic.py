"""Messages in the form in which they are sent."""

import io
import struct

import pytest

rospy = pytest.importorskip('rospy')
from rospy.msg import deserialize_messages, serialize_message

from smach_common.introspection import wire_topic
from smach_common.introspection.wire_topic import LatestMessages, serialised
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure

STAMP = rospy.Time(12, 34)
FIELDS = (['A'], ['B', 'Käse'], 'gAJ9cQAu', 'HEARTBEAT')


def read(data):
    """What a subscriber of rospy's makes of these bytes."""
    buffer, messages = io.BytesIO(), []
    buffer.write(data)
    deserialize_messages(buffer, messages, SmachContainerStatus)
    return messages


def status(seq=0):
    message = SmachContainerStatus()
    message.header.seq, message.header.stamp = seq, STAMP
    message.path = '/ROOT'
    (message.initial_states, message.active_states, message.local_data, message.info) = FIELDS
    return message


def test_it_is_what_rospy_would_have_sent():
    buffer = io.BytesIO()
    serialize_message(buffer, 7, status())
    assert wire_topic._frames([serialised(status())], 7) == [buffer.getvalue()]


def test_subscribers_read_many_in_one_go_numbered_in_turn():
    made = LatestMessages(SmachContainerStatus).make(STAMP, '/ROOT', *FIELDS)
    data = b''.join(wire_topic._frames([made] * 3, 41))
    assert read(data) == [status(41), status(42), status(43)]


def test_the_number_of_a_message_begins_again_after_the_last_one():
    (frame,) = wire_topic._frames([serialised(status())], 2**32 + 5)
    assert struct.unpack_from('<I', frame, 4) == (5,)


@pytest.fixture
def serialisations(monkeypatch):
    counted = []
    monkeypatch.setattr(
        wire_topic, 'serialised', lambda message: counted.append(message) or serialised(message)
    )
    return counted


def test_what_has_not_changed_is_not_serialised_again_but_stamped_anew(serialisations):
    latest = LatestMessages(SmachContainerStatus)
    first = latest.make(STAMP, '/ROOT', *FIELDS)
    later = latest.make(rospy.Time(13), '/ROOT', *FIELDS)
    assert len(serialisations) == 1
    assert (later.stamp, later.body) == (rospy.Time(13), first.body)


@pytest.mark.parametrize('place', range(4))
def test_a_change_of_any_field_is_sent(place, serialisations):
    latest = LatestMessages(SmachContainerStatus)
    latest.make(STAMP, '/ROOT', *FIELDS)
    changed = list(FIELDS)
    changed[place] = ['OTHER'] if isinstance(FIELDS[place], list) else 'OTHER'
    made = latest.make(STAMP, '/ROOT', *changed)
    (message,) = read(b''.join(wire_topic._frames([made], 1)))
    assert [
        message.initial_states,
        message.active_states,
        message.local_data,
        message.info,
    ] == changed
    assert len(serialisations) == 2


def test_containers_are_not_mixed_up():
    latest = LatestMessages(SmachContainerStatus)
    one, two = (latest.make(STAMP, path, *FIELDS) for path in ('/ONE', '/TWO'))
    assert [message.path for message in read(b''.join(wire_topic._frames([one, two], 1)))] == [
        '/ONE',
        '/TWO',
    ]


def test_what_is_gone_or_large_is_not_kept(serialisations):
    latest = LatestMessages(SmachContainerStatus)
    latest.make(STAMP, '/GONE', *FIELDS)
    latest.make(STAMP, '/STAYS', *FIELDS)
    latest.keep_only(['/STAYS', '/NEW'])
    latest.make(STAMP, '/GONE', *FIELDS)
    latest.make(STAMP, '/STAYS', *FIELDS)
    assert [message.path for message in serialisations] == ['/GONE', '/STAYS', '/GONE']
    for _ in range(2):
        latest.make(STAMP, '/LARGE', [], [], 'x' * (wire_topic.LARGEST_KEPT + 1), '')
    assert [message.path for message in serialisations[3:]] == ['/LARGE', '/LARGE']


def test_what_is_no_text_is_written_out():
    latest = LatestMessages(SmachContainerStatus)
    for _ in range(2):
        made = latest.make(STAMP, '/\ud800', ['Käse', '\udcff'], [], 'x', '')
        (message,) = read(b''.join(wire_topic._frames([made], 1)))
        assert (message.path, message.initial_states) == ('/\\ud800', ['Käse', '\\udcff'])


def test_a_field_of_another_kind_is_the_callers_affair():
    with pytest.raises(Exception, match='children must be a list'):
        LatestMessages(SmachContainerStructure).make(STAMP, '/ROOT', None, [], [], [], [])
