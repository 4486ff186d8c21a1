"""Structures of machines, and images of failures, read from bags without ROS."""

from typing import Any, Dict, Iterator, List, NamedTuple, Tuple

from .bag_events import MessageStores

STRUCTURE_TYPE = 'smach_msgs/msg/SmachContainerStructure'
FRAMES_TYPE = 'smach_oracle/msg/FailureFrames'
MOST_CONTAINERS = 200
MOST_FRAMES = 40


class RecordedContainer(NamedTuple):
    """One container's structure, by labels."""

    children: Tuple[str, ...]
    edges: Tuple[Tuple[str, str, str], ...]  # source, outcome, target
    outcomes: Tuple[str, ...]


class FailureImage(NamedTuple):
    """An image that one camera saw when a question was put."""

    query_id: str
    topic: str
    format: str  # of CompressedImage
    data: bytes


class RecordedMachines(NamedTuple):
    """The machines of a bag."""

    containers: Dict[str, RecordedContainer]  # by path, as in events, the latest word on each
    frames: List[FailureImage]


def read_machines(path: str) -> RecordedMachines:
    """Read a bag that has events in it. A damaged one may raise anything."""
    containers: Dict[str, RecordedContainer] = {}
    frames: List[FailureImage] = []
    stores = MessageStores()
    from rosbags.rosbag1 import Reader  # only where bags are read

    with Reader(path) as reader:
        connections = [
            item for item in reader.connections if item.msgtype in (STRUCTURE_TYPE, FRAMES_TYPE)
        ]
        for item, _, data in reader.messages(connections) if connections else ():
            message = stores.read(item, data)
            if item.msgtype == FRAMES_TYPE:
                frames += list(_frames(message))[: MOST_FRAMES - len(frames)]
            elif len(containers) < MOST_CONTAINERS:
                containers[message.path.lstrip('/')] = _container(message)
    return RecordedMachines(containers, frames)


def _container(message: Any) -> RecordedContainer:
    edges = zip(message.outcomes_from, message.internal_outcomes, message.outcomes_to)
    return RecordedContainer(
        tuple(message.children), tuple(edges), tuple(message.container_outcomes)
    )


def _frames(message: Any) -> Iterator[FailureImage]:
    for topic, image in zip(message.topics, message.images):
        yield FailureImage(message.query_id, topic, image.format, bytes(image.data))
