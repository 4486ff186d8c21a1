"""Encodes userdata for other processes.

Plain data becomes JSON. Messages and lists of them become serialised ROS messages.

    encode(key, value) -> UserdataItem     encode_all(mapping) -> [UserdataItem]
    decode(item) -> value                  decode_all(items) -> {key: value}
    check(item)

What fits neither encoding, or is larger than a limit, becomes an UNSENT item that names its Python
type, so that a person at least sees that the key exists. Nothing is ever pickled. A tuple arrives
as a list.
"""

import io
import json
import math
import re
import struct
from typing import Any, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence

import genpy
import roslib.message

from smach_common.foreign import ends_program, repr_of, text_of, type_name
from smach_oracle.msg import UserdataItem
from smach_oracle.oracle.errors import OracleError

from .strict_json import load_json

SUMMARY_BYTES = 4096  # a question is read by people: larger values only slow the list down
TRANSFER_BYTES = 64 * 1024 * 1024  # between programs: a camera image passes, a runaway does not

_LENGTH = struct.Struct('<I')
_MD5SUM = re.compile(r'[0-9a-f]{32}\Z')
_MESSAGE_TYPE = re.compile(r'[a-zA-Z][a-zA-Z0-9_]*/[a-zA-Z][a-zA-Z0-9_]*\Z')


class UserdataCodecError(OracleError, ValueError):
    """A malformed item. The text names the key."""


def encode(key: str, value: object, limit_bytes: int = TRANSFER_BYTES) -> UserdataItem:
    """Return one key and its value, packed as JSON or as ROS messages.

    A value that cannot be packed, takes more than `limit_bytes`, or raises as it is looked at, is
    UNSENT.

    :raises UserdataCodecError: if the key is not a string.
    """
    if not isinstance(key, str):
        raise UserdataCodecError('userdata key {} is not a string'.format(repr_of(key)))
    try:
        return _encoded(key, value, limit_bytes) or _unsent(key, _python_type(value))
    except BaseException as err:
        if ends_program(err):
            raise
        return _unsent(key, _python_type(value))


def _encoded(key: str, value: object, limit_bytes: int) -> Optional[UserdataItem]:
    """The item, or None where the value does not fit."""
    if issubclass(type(value), genpy.Message):
        return _encode_messages(key, UserdataItem.ROS_MESSAGE, [value], limit_bytes)
    messages = _message_list(value)
    if messages is not None:
        return _encode_messages(key, UserdataItem.ROS_MESSAGES, messages, limit_bytes)
    text = _json_bytes(value, limit_bytes)
    if text is None:
        return None
    return UserdataItem(key=key, encoding=UserdataItem.JSON, value=text)


def encode_all(values: Mapping[str, Any], limit_bytes: int = TRANSFER_BYTES) -> List[UserdataItem]:
    """Return every key of a mapping, in the order of the keys. `limit_bytes` holds for each value.

    A key that is no string (SMACH does not mind) is named, and its value UNSENT.
    """
    items = sorted(values.items(), key=lambda item: text_of(item[0]))
    return [
        encode(key, value, limit_bytes)
        if isinstance(key, str)
        else _unsent(text_of(key), _python_type(value))
        for key, value in items
    ]


def decode(item: UserdataItem) -> Any:
    """Return the value of one item.

    :raises UserdataCodecError: if it is malformed, UNSENT, or a message of another md5 than ours.
    """
    if item.encoding == UserdataItem.JSON:
        return _decode_json(item)
    if item.encoding == UserdataItem.ROS_MESSAGE:
        return _deserialize(item, bytes(item.value), _message_class(item))
    if item.encoding == UserdataItem.ROS_MESSAGES:
        message_class = _message_class(item)
        return [_deserialize(item, part, message_class) for part in _parts(item)]
    if item.encoding == UserdataItem.UNSENT:
        raise UserdataCodecError(
            'userdata {!r}: its value (a {}) was not sent'.format(item.key, item.type or '?')
        )
    raise UserdataCodecError(
        'userdata {!r}: encoding {} is unknown; allowed: JSON (1), ROS_MESSAGE (2), UNSENT (3), '
        'ROS_MESSAGES (4)'.format(item.key, item.encoding)
    )


def check(item: UserdataItem) -> None:
    """Check an item that goes on to another process, which may have types that are missing here.

    :raises UserdataCodecError: where `decode` would raise there: what is wrong or missing.
    """
    if item.encoding not in (UserdataItem.ROS_MESSAGE, UserdataItem.ROS_MESSAGES):
        decode(item)
        return
    _check_type_name(item)
    if not _MD5SUM.match(item.md5sum):
        raise UserdataCodecError(
            'userdata {!r}: md5sum {!r} of {} is wrong. `rosmsg md5 {}` prints it'.format(
                item.key, item.md5sum, item.type, item.type
            )
        )
    if getattr(roslib.message.get_message_class(item.type), '_md5sum', '') == item.md5sum:
        decode(item)
    elif item.encoding == UserdataItem.ROS_MESSAGES:
        list(_parts(item))


def decode_all(items: Iterable[UserdataItem], skip_unsent: bool = False) -> Dict[str, Any]:
    """Return all items as a dictionary, with `skip_unsent` without those that were not sent.

    :raises UserdataCodecError: as `decode` does, and if a key comes twice.
    """
    values: Dict[str, Any] = {}
    for item in items:
        if skip_unsent and item.encoding == UserdataItem.UNSENT:
            continue
        if item.key in values:
            raise UserdataCodecError('userdata {!r} comes twice'.format(item.key))
        values[item.key] = decode(item)
    return values


def _message_list(value: Any) -> Optional[Sequence[genpy.Message]]:
    """The messages in a list of one type, such as the objects of a detection, else None."""
    if not (
        issubclass(type(value), (list, tuple))
        and value
        and issubclass(type(value[0]), genpy.Message)
    ):
        return None
    return value if all(type(item) is type(value[0]) for item in value) else None


def _json_bytes(value: object, limit_bytes: int) -> Optional[bytes]:
    """UTF-8 JSON, or None where the value is not plain data or too large."""
    try:
        if not _is_plain(value, limit_bytes):
            return None
        text = json.dumps(value, allow_nan=False).encode('utf-8')
    except (RuntimeError, ValueError, TypeError):  # another thread changes it as we read
        return None
    return text if len(text) <= limit_bytes else None


def _encode_messages(
    key: str, encoding: int, messages: Sequence[genpy.Message], limit_bytes: int
) -> UserdataItem:
    buffer = io.BytesIO()
    single = encoding == UserdataItem.ROS_MESSAGE
    try:
        for message in messages:
            start = buffer.tell()
            if not single:
                buffer.write(_LENGTH.pack(0))
            message.serialize(buffer)
            if not single:
                buffer.getbuffer()[start : start + _LENGTH.size] = _LENGTH.pack(
                    buffer.tell() - start - _LENGTH.size
                )
            if buffer.tell() > limit_bytes:
                return _unsent(key, _python_type(messages) if not single else message._type)
    except Exception:  # fields of the wrong type: the message itself is broken
        return _unsent(key, messages[0]._type)
    return UserdataItem(
        key=key,
        encoding=encoding,
        type=messages[0]._type,
        md5sum=messages[0]._md5sum,
        value=buffer.getvalue(),
    )


def _decode_json(item: UserdataItem) -> object:
    try:
        return load_json(bytes(item.value).decode('utf-8'))
    except (ValueError, RecursionError) as err:
        raise UserdataCodecError('userdata {!r} is not JSON: {}'.format(item.key, err)) from err


def _check_type_name(item: UserdataItem) -> None:
    """Check it, and so keep odd names away from the import that follows."""
    if not item.type:
        raise UserdataCodecError(
            'userdata {!r}: the type of its ROS message is missing, such as '
            'geometry_msgs/PoseStamped'.format(item.key)
        )
    if not _MESSAGE_TYPE.match(item.type):
        raise UserdataCodecError(
            'userdata {!r}: {!r} is not the name of a message type'.format(item.key, item.type)
        )


def _message_class(item: UserdataItem) -> type:
    _check_type_name(item)
    message_class = roslib.message.get_message_class(item.type)
    if message_class is None:
        raise UserdataCodecError(
            'userdata {!r}: message type {} is not installed here'.format(item.key, item.type)
        )
    if message_class._md5sum != item.md5sum:
        raise UserdataCodecError(
            'userdata {!r}: {} has md5 {} here and {} at the sender'.format(
                item.key, item.type, message_class._md5sum, item.md5sum or '(none)'
            )
        )
    return message_class


def _parts(item: UserdataItem) -> Iterator[bytes]:
    """The serialised messages of a list, each behind its length."""
    data = bytes(item.value)
    position = 0
    while position < len(data):
        start = position + _LENGTH.size
        length = _LENGTH.unpack_from(data, position)[0] if start <= len(data) else -1
        if length < 0 or start + length > len(data):
            raise UserdataCodecError(
                'userdata {!r}: its list of {} is cut off at byte {}'.format(
                    item.key, item.type, position
                )
            )
        yield data[start : start + length]
        position = start + length


def _deserialize(item: UserdataItem, data: bytes, message_class: type) -> genpy.Message:
    message = message_class()
    try:
        message.deserialize(data)
        again = io.BytesIO()
        message.serialize(again)
    except Exception as err:  # generated code raises whatever the bytes drive it to
        raise UserdataCodecError(
            'userdata {!r}: {} bytes are no {}: {}'.format(item.key, len(data), item.type, err)
        ) from err
    if again.getvalue() != data:  # genpy reads past a short end without a word
        raise UserdataCodecError(
            'userdata {!r}: its {} bytes are not those of a {}'.format(
                item.key, len(data), item.type
            )
        )
    return message


def _is_plain(value: object, budget_bytes: int) -> bool:
    """Whether JSON holds it without loss, looking at no more of it than the budget allows.

    Goes by a list, not by recursion: neither depth nor a cycle can overrun the stack.
    """
    waiting = [(value, 0)]
    while waiting:
        item, depth = waiting.pop()
        budget_bytes -= 1 + (len(item) if isinstance(item, str) else 0)
        if budget_bytes < 0 or depth > 100:
            return False
        if isinstance(item, dict):
            if not all(isinstance(key, str) for key in item):
                return False
            budget_bytes -= sum(len(key) for key in item)
            waiting.extend((child, depth + 1) for child in item.values())
        elif isinstance(item, (list, tuple)):
            if len(item) > budget_bytes:
                return False
            waiting.extend((child, depth + 1) for child in item)
        elif not _is_plain_leaf(item):
            return False
    return True


def _is_plain_leaf(item: object) -> bool:
    if isinstance(item, float):
        return math.isfinite(item)
    return item is None or isinstance(item, (bool, int, str))


def _unsent(key: str, type_name: str) -> UserdataItem:
    return UserdataItem(key=key, encoding=UserdataItem.UNSENT, type=type_name)


def _python_type(value: object) -> str:
    name = type_name(value)
    return name[len('builtins.') :] if name.startswith('builtins.') else name
