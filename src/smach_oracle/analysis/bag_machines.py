"""Structures of machines, and what was seen of failures, read from bags without ROS."""

from typing import Any, Dict, Iterator, List, NamedTuple, Tuple

from .bag_events import MessageStores

STRUCTURE_TYPE = 'smach_msgs/msg/SmachContainerStructure'
FRAMES_TYPE = 'smach_oracle/msg/FailureFrames'
REPLAY_TYPE = 'smach_oracle/msg/FailureReplay'
MOST_CONTAINERS = 200
MOST_FRAMES = 40
MOST_REPLAYS = 64
MOST_REPLAYED = 2400  # images of one, and joint states of one
MOST_JOINTS = 100  # of a joint state


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


class ReplayImage(NamedTuple):
    """An image that came in the last seconds before a failure."""

    topic: str
    came_s: float  # ROS time
    format: str  # of CompressedImage
    data: bytes


class ReplayJoints(NamedTuple):
    """A joint state that came then."""

    came_s: float  # ROS time
    names: List[str]
    positions: List[float]


class RecordedReplay(NamedTuple):
    """What came before a failure and after the one before it, as FailureReplay.msg has it."""

    trial_id: str
    seq: int  # of the failure's event
    at_s: float  # ROS time of the failure
    seconds: float  # how long before that it may begin
    images: List[ReplayImage]
    joints: List[ReplayJoints]


class RecordedMachines(NamedTuple):
    """The machines of a bag."""

    containers: Dict[str, RecordedContainer]  # by path, as in events, the latest word on each
    frames: List[FailureImage]
    replays: List[RecordedReplay]


def read_machines(path: str) -> RecordedMachines:
    """Read a bag that has events in it. A damaged one may raise anything."""
    containers: Dict[str, RecordedContainer] = {}
    frames: List[FailureImage] = []
    replays: List[RecordedReplay] = []
    stores = MessageStores()
    from rosbags.rosbag1 import Reader  # only where bags are read

    with Reader(path) as reader:
        connections = [
            item
            for item in reader.connections
            if item.msgtype in (STRUCTURE_TYPE, FRAMES_TYPE, REPLAY_TYPE)
        ]
        for item, _, data in reader.messages(connections) if connections else ():
            message = stores.read(item, data)
            if item.msgtype == FRAMES_TYPE:
                frames += list(_frames(message))[: MOST_FRAMES - len(frames)]
            elif item.msgtype == REPLAY_TYPE:
                replays += [_replay(message)] if len(replays) < MOST_REPLAYS else []
            elif len(containers) < MOST_CONTAINERS:
                containers[message.path.lstrip('/')] = _container(message)
    return RecordedMachines(containers, frames, replays)


def _container(message: Any) -> RecordedContainer:
    edges = zip(message.outcomes_from, message.internal_outcomes, message.outcomes_to)
    return RecordedContainer(
        tuple(message.children), tuple(edges), tuple(message.container_outcomes)
    )


def _frames(message: Any) -> Iterator[FailureImage]:
    for topic, image in zip(message.topics, message.images):
        yield FailureImage(message.query_id, topic, image.format, bytes(image.data))


def _replay(message: Any) -> RecordedReplay:
    topics = list(message.topics)
    images = [
        ReplayImage(topics[camera], _seconds(came), image.format, bytes(image.data))
        for came, camera, image in zip(message.images_came, message.cameras, message.images)
        if camera < len(topics)
    ]
    joints = [
        ReplayJoints(
            _seconds(came),
            list(state.name)[:MOST_JOINTS],
            [float(each) for each in state.position[:MOST_JOINTS]],
        )
        for came, state in zip(message.joints_came, message.joints)
    ]
    return RecordedReplay(
        message.trial_id,
        int(message.seq),
        _seconds(message.header.stamp),
        float(message.seconds),
        images[-MOST_REPLAYED:],
        joints[-MOST_REPLAYED:],
    )


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)
