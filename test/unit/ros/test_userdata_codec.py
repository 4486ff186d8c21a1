"""What of a userdata dictionary arrives on the other side, and what is refused."""

import io
import math
import pickle

import pytest
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from std_msgs.msg import String

from smach_oracle.msg import UserdataItem
from smach_oracle.oracle.errors import OracleError
from smach_oracle.ros.userdata_codec import (
    UserdataCodecError,
    decode,
    decode_all,
    encode,
    encode_all,
)


def over_the_wire(item):
    buffer = io.BytesIO()
    item.serialize(buffer)
    return UserdataItem().deserialize(buffer.getvalue())


@pytest.mark.parametrize(
    'value',
    [
        None,
        True,
        0,
        -3,
        1.5,
        '',
        'Tür ✓',
        [],
        {},
        [1, [2, {'a': None}]],
        {'x': {'y': [1.25, 'z']}},
        10**30,
    ],
)
def test_plain_data_arrives_as_it_was(value):
    item = over_the_wire(encode('key', value))
    assert item.encoding == UserdataItem.JSON
    assert decode(item) == value and type(decode(item)) is type(value)


def test_a_tuple_arrives_as_a_list():
    assert decode(encode('key', (1, (2, 3)))) == [1, [2, 3]]


def test_a_ros_message_arrives_as_that_message():
    pose = PoseStamped()
    pose.header.frame_id = 'base_link'
    pose.pose.position.x = 0.25
    item = over_the_wire(encode('pose', pose))
    assert (item.encoding, item.type) == (UserdataItem.ROS_MESSAGE, 'geometry_msgs/PoseStamped')
    assert decode(item) == pose


class Opaque:
    pass


def cyclic():
    ring = []
    ring.append(ring)
    return ring


def deep(levels):
    value = []
    for _ in range(levels):
        value = [value]
    return value


@pytest.mark.parametrize(
    'value, type_name',
    [
        (Opaque(), __name__ + '.Opaque'),
        (b'bytes', 'bytes'),
        ({1: 'a'}, 'dict'),
        ({1, 2}, 'set'),
        (math.nan, 'float'),
        ([math.inf], 'list'),
        ([1, Opaque()], 'list'),
        (cyclic(), 'list'),
        (deep(5000), 'list'),
    ],
)
def test_what_fits_neither_is_named_and_not_sent(value, type_name):
    item = encode('key', value)
    assert (item.encoding, item.type, bytes(item.value)) == (UserdataItem.UNSENT, type_name, b'')


def test_a_value_above_the_limit_is_named_and_not_sent():
    assert encode('text', 'x' * 5000, 4096).encoding == UserdataItem.UNSENT
    assert encode('text', 'x' * 4000, 4096).encoding == UserdataItem.JSON
    # six bytes each in JSON
    assert encode('wide', '\u00e4' * 1000, 4096).encoding == UserdataItem.UNSENT
    item = encode('message', String('x' * 5000), 4096)
    assert (item.encoding, item.type) == (UserdataItem.UNSENT, 'std_msgs/String')


def test_a_message_with_broken_fields_is_named_and_not_sent():
    assert encode('message', String(data=3)).encoding == UserdataItem.UNSENT


def test_a_key_that_is_no_string_is_refused():
    with pytest.raises(UserdataCodecError, match='3 is not a string'):
        encode(3, 'value')


def json_item(text):
    return UserdataItem(key='k', encoding=UserdataItem.JSON, value=text)


def message_item(**fields):
    item = encode('k', String('hello'))
    for name, value in fields.items():
        setattr(item, name, value)
    return item


@pytest.mark.parametrize(
    'item, text',
    [
        (json_item(b''), "'k' is not JSON"),
        (json_item(b'{"a": '), "'k' is not JSON"),
        (json_item(b'\xff\xfe'), "'k' is not JSON"),
        (json_item(b'NaN'), 'NaN is not a JSON number'),
        (json_item(b'1e999'), '1e999 is too large for a number'),
        (json_item(b'{"x": [-1e400]}'), '-1e400 is too large for a number'),
        (message_item(type=''), 'the type of its ROS message is missing'),
        (json_item(b'[' * 100000), "'k' is not JSON"),
        (json_item(pickle.dumps({'a': 1})), "'k' is not JSON"),
        (message_item(md5sum='0' * 32), 'has md5 .* at the sender'),
        (message_item(md5sum=''), r'\(none\) at the sender'),
        (message_item(type='no_such_package/Thing'), 'is not installed here'),
        (message_item(type='std_msgs/NoSuch'), 'is not installed here'),
        (message_item(type='os.path/join'), 'not the name of a message type'),
        (message_item(type='std_msgs/String\n'), 'not the name of a message type'),
        (message_item(value=b'\x09'), 'bytes are no std_msgs/String'),
        (message_item(value=b'\x09\x00\x00\x00abc'), 'are not those of a std_msgs/String'),
        (message_item(value=b'\x01\x00\x00\x00abc'), 'are not those of a std_msgs/String'),
        (
            UserdataItem(key='k', encoding=UserdataItem.UNSENT, type='set'),
            r'\(a set\) was not sent',
        ),
        (UserdataItem(key='k', encoding=9), 'encoding 9 is unknown; allowed'),
    ],
)
def test_malformed_items_are_refused_with_what_is_wrong(item, text):
    with pytest.raises(UserdataCodecError, match=text) as caught:
        decode(item)
    assert isinstance(caught.value, OracleError) and isinstance(caught.value, ValueError)
    assert "'k'" in str(caught.value)


def test_a_whole_dictionary_arrives():
    values = {'b': [1], 'a': String('x')}
    items = encode_all(values)
    assert [item.key for item in items] == ['a', 'b']
    assert decode_all(items) == values


def test_a_key_that_comes_twice_is_refused():
    with pytest.raises(UserdataCodecError, match="'a' comes twice"):
        decode_all([encode('a', 1), encode('a', 2)])


def test_unsent_values_are_left_out_only_when_told():
    items = encode_all({'a': 1, 'image': Opaque()})
    assert decode_all(items, skip_unsent=True) == {'a': 1}
    with pytest.raises(UserdataCodecError, match="'image'"):
        decode_all(items)


def test_a_list_of_messages_of_one_type_arrives_as_that_list() -> None:
    points = [Point(1.0, 2.0, 3.0), Point(4.0, 5.0, 6.0)]
    item = encode('corners', points)
    assert (item.encoding, item.type) == (UserdataItem.ROS_MESSAGES, 'geometry_msgs/Point')
    assert decode(item) == points


def test_a_list_of_messages_that_was_cut_off_is_refused() -> None:
    item = encode('corners', [Point(), Point()])
    item.value = item.value[:-5]
    with pytest.raises(UserdataCodecError, match='cut off'):
        decode(item)


def test_a_list_of_unlike_messages_and_one_beyond_the_limit_are_named_but_not_sent() -> None:
    assert encode('mixed', [Point(), Quaternion()]).encoding == UserdataItem.UNSENT
    assert encode('long', [Point()] * 10, limit_bytes=100).encoding == UserdataItem.UNSENT
