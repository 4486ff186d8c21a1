"""The last seconds before a failure: bounded in memory, for the question and for the bag."""

import itertools
import random
import threading
from types import SimpleNamespace

import numpy as np
import pytest
import rosgraph
import rospy
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header
from waiting import wait_for

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.images import colour_image
from smach_oracle.ros.recording.event_packing import serialise
from smach_oracle.ros.replay import failure_replays, replay_settings
from smach_oracle.ros.replay.failure_replays import FailureReplays, Pace
from smach_oracle.ros.replay.replay_settings import ReplaySettings

EYE, HAND = '/eye/image_raw', '/hand/image_raw'
JOINTS = '/joint_states'
GREY = np.full((48, 64, 3), 90, np.uint8)
USUAL = ReplaySettings((EYE, HAND), (JOINTS,))


class FakeRobot:
    """A ring without a node: a clock to be set, topics to be published on."""

    def __init__(self, monkeypatch):
        self.now_s, self.wall_s = 1000.0, 0.0
        self.topics, self.published, self.in_bag, self.warnings = {}, [], [], []
        names = [[EYE, Image._type], [HAND, Image._type], [JOINTS, JointState._type]]
        master = SimpleNamespace(getTopicTypes=lambda: names)
        publisher = SimpleNamespace(publish=self.published.append)
        monkeypatch.setattr(rosgraph, 'Master', lambda name: master)
        monkeypatch.setattr(rospy, 'Subscriber', self.subscribe)
        monkeypatch.setattr(rospy, 'Publisher', lambda *_, **__: publisher)
        monkeypatch.setattr(rospy, 'get_name', lambda: '/robot')
        monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
        monkeypatch.setattr(rospy, 'resolve_name', lambda name: name.replace('~', '/robot/'))
        monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time.from_sec(self.now_s))
        monkeypatch.setattr(
            rospy, 'logwarn', lambda *args: self.warnings.append(args[0] % args[1:])
        )
        monkeypatch.setattr(failure_replays, 'time', SimpleNamespace(monotonic=lambda: self.wall_s))
        self.source = EventSource(self.warnings.append)

    def subscribe(self, topic, kind, take, callback_args, **_):
        self.topics[topic] = lambda message: take(message, callback_args)
        return SimpleNamespace(unregister=lambda: None)

    def keep(self, settings=USUAL):
        replays = FailureReplays(settings, lambda *told: self.in_bag.append(told))
        assert wait_for(lambda: set(self.topics) == {*settings.cameras, *settings.joints})
        replays.watch(self.source)
        replays.watch(self.source)
        self.ring = replays._ring
        return replays

    def see(self, topic=EYE, colour=GREY, passing_s=1.0):
        """An image comes, and is small before this returns."""
        before = self.ring.freeze(rospy.get_rostime()).images
        self.topics[topic](colour_image(colour, Header()))
        assert wait_for(lambda: self.ring.freeze(rospy.get_rostime()).images[-1:] != before[-1:])
        self.pass_time(passing_s)

    def pass_time(self, seconds):
        self.now_s += seconds
        self.wall_s += seconds

    def begin(self, trial='t'):
        self.source.begin_trial(trial)
        self.source.emit(EventKind.TRIAL_START, 'TOP')

    def fail(self):
        self.source.emit(EventKind.FAILURE, 'TOP', state='PICK', outcome='aborted')

    def ask(self, query_id='q1'):
        self.source.emit(EventKind.QUERY_OPENED, 'TOP', state='PICK', query_id=query_id)
        assert wait_for(lambda: self.published, 5.0), self.warnings
        return self.published[-1]


@pytest.fixture(name='robot')
def make_robot(monkeypatch):
    return FakeRobot(monkeypatch)


def came(stamps):
    return [stamp.to_sec() for stamp in stamps]


def test_a_question_has_what_came_before_its_failure_and_nothing_later(robot):
    robot.keep()
    robot.begin()
    for second in range(40):
        robot.see(EYE)
        robot.topics[JOINTS](JointState(name=['elbow'], position=[second]))
    robot.fail()
    robot.pass_time(5.0)
    robot.see(HAND)
    told = robot.ask('q7')
    assert (told.query_id, told.trial_id, told.header.stamp.to_sec()) == ('q7', 't', 1040.0)
    assert came(told.images_came) == [1010.0 + number for number in range(30)]
    assert {told.topics[camera] for camera in told.cameras} == {EYE}
    assert [joints.position for joints in told.joints] == [[second] for second in range(9, 40)]
    assert [event.kind for event in told.events] == [EventKind.FAILURE], 'the start is too old'
    assert told.seq == told.events[0].seq


def test_a_question_without_a_failure_has_what_came_before_it(robot):
    robot.keep()
    robot.begin()
    robot.see(HAND)
    told = robot.ask()
    assert [told.topics[camera] for camera in told.cameras] == [HAND]
    assert [event.kind for event in told.events] == [EventKind.TRIAL_START, EventKind.QUERY_OPENED]


def test_a_question_long_after_a_failure_has_what_came_before_the_question(robot):
    robot.keep()
    robot.begin()
    robot.fail()
    robot.pass_time(100.0)
    robot.see()
    assert robot.ask().header.stamp.to_sec() == 1101.0


def test_events_of_another_machine_are_not_in_a_question(robot):
    replays = robot.keep()
    other = EventSource(robot.warnings.append)
    replays.watch(other)
    other.begin_trial('other')
    other.emit(EventKind.STATE_START, 'OTHER', state='DRIVE')
    robot.begin()
    robot.fail()
    assert {event.path for event in robot.ask().events} == {'TOP'}


def test_each_image_lies_in_a_bag_once(robot):
    robot.keep()
    robot.begin()
    robot.see()
    robot.see()
    robot.fail()
    robot.fail()
    robot.see()
    robot.fail()
    (first, second) = robot.in_bag
    assert {first[:2], second[:2]} == {('t', '/robot/failure_replay')}
    assert [came(told[2].images_came) for told in robot.in_bag] == [[1000.0, 1001.0], [1002.0]]
    assert not second[2].events and not second[2].text


def test_a_bag_of_the_next_trial_has_its_own_quota_and_images(robot):
    robot.keep()
    robot.see()
    for trial in ('t', 'u'):
        robot.begin(trial)
        robot.fail()
        robot.source.emit(EventKind.TRIAL_END, 'TOP')
    assert [(told[0], len(told[2].images)) for told in robot.in_bag] == [('t', 1), ('u', 1)]


def test_a_bag_keeps_to_its_quota_and_says_what_was_left_out(robot):
    quota = 30000
    robot.keep(USUAL._replace(bag_bytes=quota, width=64))
    chance = np.random.default_rng(3)
    robot.begin()
    for _ in range(12):
        for _ in range(4):
            noise = chance.integers(0, 255, (48, 64, 3), np.uint8)
            robot.topics[JOINTS](JointState(name=['elbow'], position=[1.0]))
            robot.see(EYE, noise, passing_s=0.5)
        robot.fail()
    told = [message for _, _, message in robot.in_bag]
    images = sum(len(message.images) for message in told)
    left_out = sum(message.images_left_out for message in told)
    assert images and left_out and images + left_out == 48
    content = sum(len(serialise(message)) - len(serialise(bare(message))) for message in told)
    assert 0.8 * quota < content <= quota
    assert 'are left out: ~replay_bag_mb allows 0.03 MB' in told[-1].text
    cut = next(message for message in told if message.images_left_out)
    assert came(cut.images_came) == came(cut.images_came)[-len(cut.images) :], 'the newest stay'
    assert not told[0].text


def bare(message):
    """A message without what came."""
    fresh = type(message)()
    fresh.deserialize(serialise(message))
    fresh.images, fresh.joints, fresh.cameras = [], [], b''
    fresh.images_came, fresh.joints_came = [], []
    return fresh


def test_a_quota_of_nothing_puts_nothing_into_a_bag(robot):
    robot.keep(USUAL._replace(bag_bytes=0))
    robot.begin()
    robot.see()
    robot.fail()
    assert robot.in_bag == []
    assert robot.ask().images


@pytest.mark.parametrize('seed', range(3))
def test_the_ring_stays_within_its_bytes(robot, seed):
    """Of images, joint states and events of any size, at any rate."""
    chance = random.Random(seed)
    most = 200000
    robot.keep(USUAL._replace(most_bytes=most, width=400))
    noise = np.random.default_rng(seed)
    robot.begin()
    for _ in range(150):
        robot.pass_time(chance.choice([0.3, 1.0]))
        width = chance.choice([20, 200, 400])
        image = noise.integers(0, 255, (width // 2, width, 3), np.uint8)
        robot.topics[chance.choice([EYE, HAND])](colour_image(image, Header()))
        count = chance.choice([1, 50, 3000])
        robot.topics[JOINTS](JointState(name=['joint'] * count, position=[0.5] * count))
        for _ in range(20):
            data = {'text': 'x' * chance.choice([0, 10, 50000])}
            robot.source.emit(EventKind.WARNING, 'TOP', state='PICK', text='y' * 99, data=data)
        assert robot.ring.bytes <= most
    told = robot.ask()
    assert told.images and told.joints and told.events
    assert len(serialise(told)) <= most
    assert robot.warnings == []


def test_a_broken_image_is_named_once_and_costs_no_later_one(robot):
    robot.keep()
    for _ in range(3):
        robot.topics[EYE](Image(encoding='32FC1', width=1, height=1, step=4, data=bytes(4)))
        assert wait_for(lambda: robot.warnings)
        robot.pass_time(1.0)
    robot.see()
    (warning,) = robot.warnings
    assert EYE in warning and "encoding '32FC1'" in warning


def test_a_stream_is_thinned_out_by_ros_time_and_by_wall_time():
    pace = Pace(0.5)
    at_usual_speed = [pace.takes('eye', 10 + step / 30, step / 30) for step in range(300)]
    assert sum(at_usual_speed) == 20  # of ten seconds
    pace = Pace(0.5)
    fifty_times_as_fast = [pace.takes('eye', step / 30, step / 1500) for step in range(3000)]
    assert 19 <= sum(fifty_times_as_fast) <= 21  # of two seconds, ten a second
    pace = Pace(0.5)
    assert pace.takes('eye', 500.0, 1.0) and pace.takes('eye', 2.0, 2.0), 'the clock jumped back'
    assert not pace.takes('eye', 2.0, 9.0), 'the clock stands'


def test_nodes_that_share_a_topic_of_joints_are_thinned_out_each_by_itself(robot):
    robot.keep()
    for _ in range(20):
        for name in ('arm', 'gripper'):
            message = JointState(name=[name], position=[1.0])
            message._connection_header = {'callerid': '/' + name}
            robot.topics[JOINTS](message)
        robot.pass_time(0.1)
    names = [joints.name for joints in robot.ask().joints]
    assert names.count(['arm']) == names.count(['gripper']) == 10


def test_positions_keep_their_names_while_another_node_publishes_the_topic(robot):
    robot.keep()

    nodes = itertools.count()

    def publish(names, position):
        message = JointState(name=names, position=[position])
        message._connection_header = {'callerid': '/node_{}'.format(next(nodes))}
        robot.topics[JOINTS](message)

    class Overtaken(list):
        """Names: while they are counted, another thread takes in a gripper's."""

        def __len__(self):
            publish(['gripper'], 0.04)
            return super().__len__()

    publish(Overtaken(['arm']), 1.0)
    told = [(*joints.name, *joints.position) for joints in robot.ask().joints]
    assert set(told) == {('gripper', 0.04), ('arm', 1.0)}


def test_a_topic_that_is_named_twice_is_waited_for_once(robot):
    """Or the thread that asks the master would never end."""
    robot.keep(ReplaySettings((EYE, HAND, EYE), ()))
    names = ('replay cameras', 'replay joints')
    assert wait_for(lambda: not any(each.name in names for each in threading.enumerate()))


def test_a_robot_without_cameras_and_joints_keeps_nothing(monkeypatch):
    values = {}
    monkeypatch.setattr(rospy, 'get_param', lambda name, default=None: values.get(name, default))
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/robot/' + name.lstrip('~'))
    assert failure_replays.replays_of_node(None) is None
    values['~failure_cameras'] = ['eye']
    settings = replay_settings.read_settings()
    assert (settings.cameras, settings.joints) == (('/robot/eye',), ('/robot/joint_states',))
    values['~replay_s'] = 0
    assert failure_replays.replays_of_node(None) is None


@pytest.mark.parametrize(
    'name, value',
    [
        ('replay_s', -1),
        ('replay_s', 'long'),
        ('replay_mb', [6]),
        ('replay_bag_mb', True),
        ('replay_rate', 0),
        ('replay_width', 5000),
        ('replay_joints', 'joint_states'),
        ('replay_joints', ['a', 'b', 'c', 'd', 'e']),
    ],
)
def test_an_invalid_parameter_is_named(monkeypatch, name, value):
    values = {'~' + name: value}
    monkeypatch.setattr(rospy, 'get_param', lambda key, default=None: values.get(key, default))
    monkeypatch.setattr(rospy, 'resolve_name', lambda key: '/robot/' + key.lstrip('~'))
    with pytest.raises(SettingsError, match='/robot/' + name):
        replay_settings.read_settings()
