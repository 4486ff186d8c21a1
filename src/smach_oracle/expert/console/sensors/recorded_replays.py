"""The last seconds before the failures of a trial, as its bags have them."""

from typing import Dict, List, Sequence

import genpy
from sensor_msgs.msg import CompressedImage, JointState

from smach_oracle.analysis.bag_machines import RecordedReplay
from smach_oracle.msg import FailureReplay

from .question_replays import KeptReplay, kept_replay

LATEST_S = 2.0**32  # of a ROS time


def recorded_replays(recorded: Sequence[RecordedReplay]) -> Dict[int, KeptReplay]:
    """Return the replays of a trial for the page, by the numbers of their failures' events.

    In a bag nothing lies twice. So each gets what those before it hold, as far as it reaches back.
    """
    found: Dict[int, KeptReplay] = {}
    in_order = sorted(
        (each for each in recorded if 0 <= each.at_s < LATEST_S), key=lambda each: each.at_s
    )
    for position, replay in enumerate(in_order):
        kept = kept_replay(_message(replay, in_order[: position + 1]))
        if kept.view['frames'] or kept.view['joints']:
            found[replay.seq] = kept
    return found


def _message(replay: RecordedReplay, so_far: Sequence[RecordedReplay]) -> FailureReplay:
    """A replay as its robot published it, without the events, which lie next to it in the bag."""
    message = FailureReplay(seconds=replay.seconds)
    message.header.stamp = _time(replay.at_s)
    began_s = replay.at_s - replay.seconds
    topics: List[str] = []
    cameras: List[int] = []
    for each in so_far:
        for image in each.images:
            if began_s <= image.came_s < LATEST_S:
                if image.topic not in topics:
                    topics.append(image.topic)
                cameras.append(topics.index(image.topic))
                message.images_came.append(_time(image.came_s))
                message.images.append(CompressedImage(format=image.format, data=image.data))
        for joints in each.joints:
            if began_s <= joints.came_s < LATEST_S:
                message.joints_came.append(_time(joints.came_s))
                message.joints.append(JointState(name=joints.names, position=joints.positions))
    message.topics, message.cameras = topics, cameras
    return message


def _time(time_s: float) -> genpy.Time:
    return genpy.Time.from_sec(max(0.0, time_s))
