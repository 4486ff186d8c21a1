"""Reading recorded bags, as the tests want to see them."""

import glob
import os
from typing import Any, List

import rosbag

from smach_oracle.ros.recording.bag_writer import BagWriter, MessageType

STRING = MessageType('std_msgs/String', '992ce8a1687cec8c8bd883ec73ca41d1', 'string data\n')


def string_data(text: str) -> bytes:
    """A serialised std_msgs/String."""
    data = text.encode()
    return len(data).to_bytes(4, 'little') + data


def write(path: Any, texts: List[str], chunks: int = 1, topic: str = '/talk') -> BagWriter:
    """A bag with the texts spread over chunks, left open."""
    writer = BagWriter(str(path))
    for number, text in enumerate(texts):
        writer.add(topic, STRING, (100 + number, 5), string_data(text))
        if (number + 1) % max(1, len(texts) // chunks) == 0:
            writer.flush()
    return writer


def texts_in(path: Any) -> List[str]:
    """The texts of a bag that `write` wrote."""
    return [message.data for message in messages(str(path))]


def quiet(_text: str) -> None:
    """A log that nobody reads."""


def finished(folder: Any) -> List[str]:
    """Closed bags of a folder, sorted by name, that is by time."""
    return sorted(glob.glob(os.path.join(str(folder), '*.bag')))


def active(folder: Any) -> List[str]:
    """Bags that are, or were, being written."""
    return sorted(glob.glob(os.path.join(str(folder), '*.bag.active')))


def messages(path: str, topic: str = '') -> List[Any]:
    """The messages of a bag, as rosbag reads them."""
    with rosbag.Bag(path) as bag:
        return [item.message for item in bag.read_messages(topics=[topic] if topic else None)]


def events(path: str) -> List[Any]:
    """The OracleEvents of a bag."""
    return messages(path, '/oracle/events')


def numbers(path: str) -> List[int]:
    """The sequence numbers of a bag's events."""
    return [event.seq for event in events(path)]
