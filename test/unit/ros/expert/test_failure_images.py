"""What cameras saw at a failure: the newest frame of each that is still heard, and nothing from long before."""
import pytest
import rospy
from expert_fixtures import make_question
from sensor_msgs.msg import CompressedImage
from waiting import wait_for

from smach_oracle.oracle.errors import ConfigError
from smach_oracle.ros import failure_frames
from smach_oracle.ros.failure_frames import OLDEST_S, FailureCameras


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
    clock.sent = []
    monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time.from_sec(clock.now_s))
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: name)
    monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
    monkeypatch.setattr(FailureCameras, '_listen', lambda self: None)
    return clock


def test_a_camera_that_fell_silent_long_before_is_left_out(clock):
    cameras = FailureCameras(['/dead', '/alive', '/never'])
    cameras._keep(CompressedImage(format='jpeg', data=b'old'), '/dead')
    clock.now_s += OLDEST_S + 1.0
    cameras._keep(CompressedImage(format='jpeg', data=b'older'), '/alive')
    cameras._keep(CompressedImage(format='jpeg', data=b'new'), '/alive')
    cameras.tell(make_question('q7'))
    assert wait_for(lambda: clock.sent)
    told, = clock.sent
    assert (told.query_id, told.topics, [image.data for image in told.images]) == ('q7', ['/alive'], [b'new'])


def test_where_no_camera_is_heard_nothing_is_told(clock, monkeypatch):
    cameras = FailureCameras(['/dead'])
    cameras._keep(CompressedImage(), '/dead')
    clock.now_s += OLDEST_S + 1.0
    monkeypatch.setattr(failure_frames.threading, 'Thread', None)
    cameras.tell(make_question())


@pytest.mark.parametrize('topics', [['/a', ''], ['/a', 3], ['/a', '/b', '/c', '/d', '/e']])
def test_what_is_no_list_of_four_cameras_is_named(clock, topics):
    with pytest.raises(ConfigError, match='failure_cameras'):
        FailureCameras(topics)
