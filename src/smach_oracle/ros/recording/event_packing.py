"""Serialises OracleEvents fast, and tells serialised ones from damaged ones.

Through a message object an event costs five times as much, and the machine waits.
"""

import io
import struct
from typing import Callable, Optional

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

_HEAD = struct.Struct('<BIIII')  # kind, header: seq, stamp, no frame_id
_WALL_TIME = struct.Struct('<d')
_UINT64 = struct.Struct('<Q')
_FAILURE = struct.Struct('<BBdB')  # kind, class, rate, continuous
_LENGTH = struct.Struct('<I')


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
    return b''.join(
        (
            _HEAD.pack(event.kind, 0, stamp[0], stamp[1], 0),
            _WALL_TIME.pack(event.wall_time),
            _string(event.trial_id),
            _UINT64.pack(event.seq),
            _string(event.path),
            _string(event.state),
            _string(event.outcome),
            _string(event.target),
            _FAILURE.pack(
                event.failure_kind, event.failure_class, event.rate, bool(event.continuous)
            ),
            _string(event.query_id),
            _string(event.by),
            _string(event.text),
            _string(event_messages.json_of(event.data)),
        )
    )


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
        position = _after_strings(data, _HEAD.size - _LENGTH.size, 1)
        position = _after_strings(data, position + _WALL_TIME.size, 1)
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
