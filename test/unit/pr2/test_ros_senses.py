"""What a robot sees and feels through a world that publishes when it is asked; no master."""

from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Transform
from sensor_msgs.msg import CameraInfo, JointState
from std_msgs.msg import Header

from smach_oracle.pr2 import ros_senses
from smach_oracle.pr2.robot import RobotError
from smach_oracle.pr2.ros_senses import RosSenses
from smach_oracle.ros import connections
from smach_oracle.ros.images import colour_image, depth_image

COLOUR, DEPTH, INFO = (
    'head_camera/rgb/image_raw',
    'head_camera/depth_registered/image_raw',
    'head_camera/rgb/camera_info',
)


def connection():
    return SimpleNamespace(socket=object())


class World:
    """Publishes a snapshot for each time it is asked, in vain on the topics that are `lost`."""

    def __init__(self):
        self.listeners = {}  # topic -> callback
        self.connections = {}  # topic -> those of its subscriber
        self.tree = SimpleNamespace(impl=SimpleNamespace(connections=[connection()]))
        self.asked = []  # whether for a camera frame
        self.lost = []  # for each time it is asked, the topics that reach nobody; then none
        self.late = []  # (topic, message) that arrive when it is asked for the second time
        self.refusal = ''

    def subscribe(self, topic, kind, callback, **_):
        self.listeners[topic] = callback
        self.connections[topic] = [connection()]
        return SimpleNamespace(impl=SimpleNamespace(connections=self.connections[topic]))

    def close(self):
        """The connection to its service."""

    def __call__(self, camera):
        self.asked.append(camera)
        if self.refusal:
            return SimpleNamespace(ok=False, message=self.refusal)
        lost = self.lost.pop(0) if self.lost else ()
        stamp = rospy.Time(len(self.asked))
        late, self.late = (self.late, []) if len(self.asked) > 1 else ([], self.late)
        for topic, message in late:
            self.listeners[topic](message)
        for topic, message in self.snapshot(camera, stamp):
            if topic not in lost:
                self.listeners[topic](message)
        return SimpleNamespace(ok=True, stamp=stamp)

    @staticmethod
    def snapshot(camera, stamp):
        """(topic, message) of all that is published of one moment."""
        header = Header(stamp=stamp)
        number = stamp.secs
        told = [('joint_states', JointState(header, ['elbow'], [float(number)], [], []))]
        if camera:
            told += [
                (COLOUR, colour_image(np.full((2, 3, 3), number, np.uint8), header)),
                (DEPTH, depth_image(np.full((2, 3), float(number)), header)),
                (INFO, CameraInfo(header=header, K=[1, 0, 0, 0, 1, 0, 0, 0, 1])),
            ]
        return told


@pytest.fixture
def world(monkeypatch):
    made = World()
    still = SimpleNamespace(transform=Transform())
    still.transform.rotation.w = 1.0
    monkeypatch.setattr(rospy, 'Subscriber', made.subscribe)
    monkeypatch.setattr(rospy, 'ServiceProxy', lambda name, kind, persistent: made)
    monkeypatch.setattr(rospy, 'wait_for_service', lambda name, timeout: None)
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(
        ros_senses,
        'tf2_ros',
        SimpleNamespace(
            Buffer=lambda *_: SimpleNamespace(lookup_transform=lambda *_: still),
            TransformListener=lambda *_, **__: SimpleNamespace(tf_sub=made.tree),
            TransformException=LookupError,
        ),
    )
    monkeypatch.setattr(ros_senses, 'AGAIN_S', 0.05)
    monkeypatch.setattr(connections, 'GRACE_S', 0.0)
    return made


def seen(frame):
    """The numbers of the snapshots that colour and depth are of."""
    return int(frame.colour[0, 0, 0]), float(frame.depth[0, 0])


def test_a_frame_is_of_the_moment_at_which_it_was_asked_for(world):
    senses = RosSenses('world/snapshot', 20.0)
    assert seen(senses.see('base', 'eye')) == (1, 1.0)
    assert seen(senses.see('base', 'eye')) == (2, 2.0)
    assert world.asked == [True, True]


@pytest.mark.parametrize('lost', [[COLOUR], [DEPTH], [INFO], [COLOUR, DEPTH, INFO]])
def test_images_that_do_not_come_are_asked_for_again(world, lost):
    world.lost = [lost, lost]
    assert seen(RosSenses('world/snapshot', 20.0).see('base', 'eye')) == (3, 3.0)
    assert world.asked == [True] * 3


def test_joint_states_that_do_not_come_are_asked_for_again(world):
    world.lost = [['joint_states']]
    assert RosSenses('world/snapshot', 20.0).joints() == {'elbow': 2.0}


def test_images_that_come_late_are_seen_all_the_same(world):
    everything = ['joint_states', COLOUR, DEPTH, INFO]
    world.lost = [everything[1:], everything]
    world.late = World.snapshot(True, rospy.Time(1))[1:]
    assert seen(RosSenses('world/snapshot', 20.0).see('base', 'eye')) == (1, 1.0)
    assert world.asked == [True, True]


def test_after_its_time_the_topic_that_is_silent_is_named(world):
    world.lost = [[DEPTH]] * 1000
    with pytest.raises(RobotError, match='no message on .*depth_registered/image_raw'):
        RosSenses('world/snapshot', 0.2).see('base', 'eye')
    assert len(world.asked) > 1


def test_a_world_that_refuses_is_asked_for_a_frame_once(world):
    world.refusal = 'the world has stopped'
    with pytest.raises(RobotError, match='/world/snapshot: the world has stopped'):
        RosSenses('world/snapshot', 20.0).see('base', 'eye')
    assert world.asked == [True]


def test_what_is_not_connected_yet_is_named(world, monkeypatch):
    senses = RosSenses('world/snapshot', 20.0)
    assert senses.lacking() == []
    world.connections[DEPTH].clear()
    assert senses.lacking() == ['/' + DEPTH]
    world.tree.impl.connections.clear()
    world.connections['joint_states'].clear()
    assert senses.lacking() == ['/joint_states', '/' + DEPTH, '/tf']

    def absent(name, timeout):
        raise rospy.ROSException('timeout')

    monkeypatch.setattr(rospy, 'wait_for_service', absent)
    assert senses.lacking()[-1] == '/world/snapshot'
    for topic in ('joint_states', DEPTH):
        world.connections[topic].append(connection())
    assert senses.lacking() == ['/tf', '/world/snapshot']
