"""Serialises OracleEvents fast, and tells serialised ones from damaged ones.

Through a message object an event costs five times as much, and the machine waits.
"""

import io
import struct
from typing import Callable, Dict, Optional, Tuple

import genpy

from smach_oracle.bag_format import Stamp
from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.records.events import Event

from .. import event_messages
from ..sendable_text import sendable_text
from .bag_writer import MessageType

# Of the definition that `_pack_directly` is written for. With any other, events go through the
# message object.
PACKED_MD5 = 'c55b3669678f23608a1881f94e335911'
# Of earlier definitions with the same fields, which had fewer kinds of event.
EARLIER_MD5S = frozenset(['04f09f94edfdd6b539964b195d7837e8', '67052263768e7d7c201c9b0c957ecc48'])
EVENT_TYPE = MessageType(OracleEvent._type, OracleEvent._md5sum, OracleEvent._full_text)

_HEAD = struct.Struct('<BIIIId')  # kind, header: seq, stamp, no frame_id; wall time
_FRAME_ID_AT, _WALL_TIME_SIZE = 13, 8
_UINT64 = struct.Struct('<Q')
_FAILURE = struct.Struct('<BBdB')  # kind, class, rate, continuous
_LENGTH = struct.Struct('<I')
_NOTHING = ''
_FOUR_EMPTY = bytes(4 * _LENGTH.size)  # strings
_MOST_KEPT, _LONGEST_KEPT = 1000, 500  # packed strings of the latest events, and their bytes
_kept: Dict[Tuple[object, ...], bytes] = {}


def serialise(message: genpy.Message) -> bytes:
    """Return a message (genpy.Message) as it is on the wire."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def _pack_through_message(event: Event, stamp: Stamp) -> bytes:
    message = event_messages.to_msg(event)
    message.header.stamp.secs, message.header.stamp.nsecs = stamp
    return serialise(message)


def _pack_directly(event: Event, stamp: Stamp) -> bytes:
    kind, trial_id, seq, wall_time, path, state, outcome, target, *more = event
    failure_kind, failure_class, rate, continuous, query_id, by, text, data = more
    if query_id is by is text is _NOTHING and data is None:
        words = _FOUR_EMPTY
    else:
        words = _strings(query_id, by, text, event_messages.json_of(data))
    return b''.join(
        (
            _HEAD.pack(kind, 0, stamp[0], stamp[1], 0, wall_time),
            _kept_strings(trial_id),
            _UINT64.pack(seq),
            _kept_strings(path, state, outcome, target),
            _FAILURE.pack(failure_kind, failure_class, rate, bool(continuous)),
            words,
        )
    )


def _kept_strings(*values: object) -> bytes:
    """Return what `_strings` returns, of a few texts that come again and again."""
    for value in values:
        if type(value) is not str:  # it may be equal to another one, and read otherwise
            return _strings(*values)
    packed = _kept.get(values)
    if packed is None:
        packed = _strings(*values)
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        if len(packed) <= _LONGEST_KEPT:
            _kept[values] = packed
    return packed


def _strings(*values: object) -> bytes:
    return b''.join(map(_string, values))


def _string(value: object) -> bytes:
    data = sendable_text(value).encode('utf-8')
    return _LENGTH.pack(len(data)) + data


def choose_packing(md5sum: str) -> Callable[[Event, Stamp], bytes]:
    """Return the fastest function that serialises an OracleEvent of this definition (its md5).

    The stamp is ROS time, or (0, 0).
    """
    return _pack_directly if md5sum == PACKED_MD5 else _pack_through_message


def event_number(data: bytes) -> Optional[int]:
    """Return the number of a serialised OracleEvent, None where the bytes are not an event."""
    try:
        position = _after_strings(data, _FRAME_ID_AT, 1)
        position = _after_strings(data, position + _WALL_TIME_SIZE, 1)
        number: int = _UINT64.unpack_from(data, position)[0]
        position = _after_strings(data, position + _UINT64.size, 4)
        position = _after_strings(data, position + _FAILURE.size, 4)
    except (struct.error, UnicodeDecodeError):
        return None
    return number if position == len(data) else None


def _after_strings(data: bytes, position: int, count: int) -> int:
    """Return where `count` strings end that begin at a position.

    :raises struct.error: where the data end before.
    :raises UnicodeDecodeError: where one is no text.
    """
    for _ in range(count):
        start = position + 4
        position = start + _LENGTH.unpack_from(data, position)[0]
        if position > start:
            data[start:position].decode('utf-8')
    return position


pack_event = choose_packing(EVENT_TYPE.md5sum)
