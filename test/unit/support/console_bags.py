"""Bags with the last seconds before failures in them, as a recorder writes them."""

import pytest
from fake_trials import FakeMachine
from genpy import Time
from sensor_msgs.msg import CompressedImage

from smach_oracle.msg import FailureReplay
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.ros.recorder import TrialRecorder

TOPIC = '/failure_replay'


def images_of(data, *came_s, topic='/eye'):
    """Fields of FailureReplay: images of one camera, by the ROS time at which each came."""
    return {
        'topics': [topic],
        'cameras': bytes(len(came_s)),
        'images_came': [Time.from_sec(each) for each in came_s],
        'images': [CompressedImage(format='jpeg', data=data) for _ in came_s],
    }


def replay_of(seq, at_s, images, seconds=30.0, **more):
    """A message about the failure whose event has this number, at a ROS time."""
    message = FailureReplay(seq=seq, seconds=seconds, **images, **more)
    message.header.stamp = Time.from_sec(at_s)
    return message


def bag_with_replays(folder, *replays, trial_id='a trial'):
    """Record one trial, with these messages in its bag. Those that name no trial get its id."""
    recorder = TrialRecorder(folder, warn=pytest.fail)

    def tell(event):
        recorder(event)
        if event.kind == EventKind.TRIAL_START:
            for replay in replays:
                replay.trial_id = replay.trial_id or trial_id
                recorder.put(trial_id, TOPIC, replay)

    FakeMachine(tell).run(1, trial_id)
    assert recorder.close(30.0)
