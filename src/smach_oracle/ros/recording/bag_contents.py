"""The connections of a damaged bag, and those of its messages that can still be read.

A message that cannot be deserialised would keep every reader from the rest of its bag.
"""

import io
import re
import typing
from collections import Counter
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

import roslib.message

from smach_oracle import bag_format
from smach_oracle.bag_format import BagFormatError, Fields

from .bag_writer import MessageType
from .event_packing import EARLIER_MD5S, EVENT_TYPE, PACKED_MD5, event_number

EVENTS = '/oracle/events'  # the end of the topic's name
_OF_THE_SAME_NODE = ('/oracle/rates', '/record/status')
_TYPE_NAME = re.compile(r'[a-zA-Z]\w*/[a-zA-Z]\w*', re.ASCII)
_MD5SUM = re.compile(r'[0-9a-f]{32}')
_TOPIC = re.compile(r'[/~]?\w[\w/]*', re.ASCII)


class BagConnection(NamedTuple):
    """The fields of a connection record."""

    topic: str
    kind: MessageType
    details: Tuple[Tuple[str, str], ...]  # further fields, such as latching and callerid

    @property
    def has_events(self) -> bool:
        """Whether its messages are OracleEvents with the fields that are packed here."""
        return self.kind.md5sum == PACKED_MD5 or self.kind.md5sum in EARLIER_MD5S


class Connections:
    """The connections of one bag, by number: each may come several times, and be damaged."""

    def __init__(self) -> None:
        self._seen: Dict[int, typing.Counter[BagConnection]] = {}
        self._orphaned_events: typing.Counter[int] = Counter()

    def learn(self, fields: Fields, data: bytes) -> bool:
        """Take notice of a connection record.

        :returns: whether it is sound.
        """
        try:
            number = bag_format.uint32_field(fields, 'conn')
            connection = parse_connection(fields, data)
        except (BagFormatError, UnicodeDecodeError):
            return False
        self._seen.setdefault(number, Counter())[connection] += 1
        return True

    def add_orphan(self, number: int, data: bytes) -> None:
        """Take notice of a message whose connection is not known (yet)."""
        self._orphaned_events[number] += event_number(data) is not None

    def of(self, number: int) -> Optional[BagConnection]:
        """Return the connection of a number, as most of its records so far have it."""
        seen = self._seen.get(number)
        return seen.most_common(1)[0][0] if seen else None

    def all(self) -> Dict[int, BagConnection]:
        """Return all connections by number, that of the events too where its records are lost."""
        known = {number: seen.most_common(1)[0][0] for number, seen in self._seen.items()}
        if not any(connection.has_events for connection in known.values()):
            for number, count in self._orphaned_events.most_common(1):
                if count and number not in known:
                    topics = [connection.topic for connection in known.values()]
                    known[number] = BagConnection(_events_topic(topics), EVENT_TYPE, ())
        return known


def parse_connection(fields: Fields, data: bytes) -> BagConnection:
    """Parse a connection record.

    Where the type is installed, its definition mends what is wrong with that of the bag.

    :raises BagFormatError: where topic or type is damaged.
    :raises UnicodeDecodeError: where the topic, the type or another field is.
    """
    texts = {
        name: value.decode('utf-8', 'replace' if name == 'message_definition' else 'strict')
        for name, value in bag_format.parse_fields(data).items()
    }
    topics = {fields.get('topic', b'').decode('utf-8'), texts.pop('topic', '')}
    kind = _kind(
        texts.pop('type', ''), texts.pop('md5sum', ''), texts.pop('message_definition', '')
    )
    if len(topics) > 1 and kind == EVENT_TYPE:
        topics = {topic for topic in topics if topic.endswith(EVENTS)}
    topic = topics.pop() if len(topics) == 1 else ''
    if not _TOPIC.fullmatch(topic):
        raise BagFormatError('the topic of a connection is damaged')
    return BagConnection(topic, kind, tuple(sorted(texts.items())))


def is_readable(kind: MessageType, data: bytes, is_sure: bool) -> bool:
    """Whether a message can be deserialised.

    Of types that are not installed that cannot be told, and they are believed.

    :param is_sure: whether the length of `data` is known to be right.
    """
    message_class = _installed(kind.name)
    if message_class is None or kind.md5sum not in (message_class._md5sum, *EARLIER_MD5S):
        return is_sure
    message, again = message_class(), io.BytesIO()
    try:
        message.deserialize(data)
        if is_sure:
            return True
        message.serialize(again)
    except Exception:  # generated code raises whatever the bytes drive it to
        return False
    return again.getvalue() == data


def _kind(name: str, md5sum: str, definition: str) -> MessageType:
    if EVENT_TYPE.md5sum == md5sum or EVENT_TYPE.definition == definition:
        return EVENT_TYPE
    if not _TYPE_NAME.fullmatch(name):
        raise BagFormatError('the type of a connection is damaged')
    found = _installed(name)
    if found is not None and (found._md5sum == md5sum or found._full_text == definition):
        return MessageType(name, found._md5sum, found._full_text)
    if not _MD5SUM.fullmatch(md5sum):
        raise BagFormatError('the md5 of a connection is damaged')
    return MessageType(name, md5sum, definition)


def _installed(name: str) -> Any:
    """The message class of a type, or None where it is not installed."""
    try:
        return roslib.message.get_message_class(name)
    except (ValueError, ImportError):
        return None


def _events_topic(topics: List[str]) -> str:
    """The topic of the events by the node's other topics. `/oracle/events` where they are lost."""
    for topic in topics:
        for end in _OF_THE_SAME_NODE:
            if topic.endswith(end):
                return topic[: -len(end)] + EVENTS
    return EVENTS
