"""What cameras saw at a failure: the newest frame of each that is still heard, and nothing from
long before.
"""

import threading
from types import SimpleNamespace

import pytest
import rosgraph
import rospy
from expert_fixtures import make_question
from sensor_msgs.msg import CompressedImage, Image
from waiting import wait_for

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.ros.expert.failure_images import OLDEST_S, FailureCameras


@pytest.fixture(name='clock')
def make_clock(monkeypatch):
    """A clock to be set, a publisher that keeps what is published; no master."""

    class Clock:
        now_s = 100.0
        sent = []

    class FakePublisher:
        def __init__(self, *_, **__):
            self.publish = clock.sent.append

    clock = Clock()
    clock.sent, clock.heard = [], {}
    types = [[name, CompressedImage._type] for name in ('/dead', '/alive', '/never')]
    master = SimpleNamespace(getTopicTypes=lambda: types)

    def subscriber(topic, kind, keep, callback_args, **_):
        clock.heard[topic] = lambda data: keep(
            CompressedImage(format='jpeg', data=data), callback_args
        )
        return SimpleNamespace(unregister=lambda: None)

    monkeypatch.setattr(rosgraph, 'Master', lambda name: master)
    monkeypatch.setattr(rospy, 'Subscriber', subscriber)
    monkeypatch.setattr(rospy, 'get_name', lambda: '/robot')
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time.from_sec(clock.now_s))
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: name)
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    return clock


def listening(clock, *topics):
    """Cameras that are listened to."""
    cameras = FailureCameras(topics)
    assert wait_for(lambda: set(clock.heard) == set(topics))
    return cameras


def test_a_camera_that_fell_silent_long_before_is_left_out(clock):
    cameras = listening(clock, '/dead', '/alive', '/never')
    clock.heard['/dead'](b'old')
    clock.now_s += OLDEST_S + 1.0
    clock.heard['/alive'](b'older')
    clock.heard['/alive'](b'new')
    cameras.publish_for(make_question('q7'))
    assert wait_for(lambda: clock.sent)
    (told,) = clock.sent
    assert (told.query_id, told.topics, [image.data for image in told.images]) == (
        'q7',
        ['/alive'],
        [b'new'],
    )


def test_where_no_camera_is_heard_nothing_is_told(clock):
    cameras = listening(clock, '/dead')
    clock.heard['/dead'](b'old')
    clock.now_s += OLDEST_S + 1.0
    before = threading.enumerate()
    cameras.publish_for(make_question())
    assert wait_for(lambda: not set(threading.enumerate()) - set(before))
    assert clock.sent == []


def test_a_camera_whose_images_cannot_be_published_is_named_once(clock, monkeypatch):
    warnings = []
    monkeypatch.setattr(rospy, 'logwarn', lambda *args: warnings.append(args[0] % args[1:]))
    cameras = FailureCameras([])
    odd = Image(encoding='odd', width=1, height=1)
    for _ in range(3):
        cameras._publish(make_question(), [('/depth', odd)])
    assert len(warnings) == 1 and 'The images of /depth at failures cannot' in warnings[0]


@pytest.mark.parametrize('topics', [['/a', ''], ['/a', 3], ['/a', '/b', '/c', '/d', '/e']])
def test_what_is_no_list_of_four_cameras_is_named(clock, topics):
    with pytest.raises(SettingsError, match='failure_cameras'):
        FailureCameras(topics)
