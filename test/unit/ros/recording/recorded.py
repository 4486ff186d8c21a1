"""Reading recorded bags, as the tests want to see them."""
import glob
import os
from typing import Any, List

import rosbag

from smach_oracle.ros.recording.bag_writer import MessageType

STRING = MessageType('std_msgs/String', '992ce8a1687cec8c8bd883ec73ca41d1', 'string data\n')


def string_data(text: str) -> bytes:
    """A serialised std_msgs/String."""
    data = text.encode()
    return len(data).to_bytes(4, 'little') + data


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
