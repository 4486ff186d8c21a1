"""The messages in a bag, read with rosbag and with rosbags, by the definitions in the bag."""

import math
from collections import Counter
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, Tuple

import rosbag
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

EVENT_TYPE = 'smach_oracle/OracleEvent'
# fields that are left out where they have these values; None stands for NaN, which JSON lacks
EMPTY = {
    'state': '',
    'outcome': '',
    'target': '',
    'failure_kind': 0,
    'failure_class': 0,
    'rate': None,
    'continuous': False,
    'query_id': '',
    'by': '',
    'text': '',
    'data': '',
}
FIELDS = ('kind', 'wall_time', 'trial_id', 'seq', 'path') + tuple(EMPTY)

Message = Tuple[str, str, Any]  # topic, type, message


def with_rosbag(path: Path) -> List[Message]:
    """Every message, unpacked."""
    with rosbag.Bag(str(path)) as bag:
        return [(topic, message._type, message) for topic, message, _ in bag.read_messages()]


def with_rosbags(path: Path) -> List[Message]:
    """The same without ROS; types have the names that rosbag gives them."""
    return list(_with_rosbags(path))


def _with_rosbags(path: Path) -> Iterator[Message]:
    stores: Dict[str, Any] = {}
    with Reader(path) as reader:
        for connection, _, data in reader.messages():
            if connection.msgtype not in stores:
                stores[connection.msgtype] = _store(connection)
            message = stores[connection.msgtype].deserialize_ros1(data, connection.msgtype)
            yield connection.topic, connection.msgtype.replace('/msg/', '/'), message


def _store(connection: Any) -> Any:
    text = getattr(connection.msgdef, 'data', connection.msgdef)  # a string before rosbags 0.10
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, connection.msgtype))
    return store


def events(messages: List[Message]) -> List[Dict[str, Any]]:
    """The executive's events, with all their fields."""
    return [
        {field: _plain(getattr(message, field)) for field in FIELDS}
        for _, kind, message in messages
        if kind == EVENT_TYPE
    ]


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def shortened(event: Mapping[str, Any]) -> Dict[str, Any]:
    """An event without its empty fields."""
    return {
        field: value
        for field, value in event.items()
        if field not in EMPTY or value != EMPTY[field]
    }


def lengthened(event: Mapping[str, Any]) -> Dict[str, Any]:
    """The same with them."""
    return {**EMPTY, **event}


def topics(messages: List[Message]) -> Dict[str, List[Any]]:
    """Type and number of messages of each topic."""
    counts = Counter((topic, kind) for topic, kind, _ in messages)
    return {topic: [kind, count] for (topic, kind), count in sorted(counts.items())}
