#!/usr/bin/env python3
"""The last seconds before a failure, with real cameras, joints, questions and bags. Under simulated
time, too (failure_replay_sim_time.test), which runs three times as fast.
"""

import glob
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest

import cv2
import numpy as np
import rosbag
import rosgraph
import rospy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, Image, JointState
from std_msgs.msg import Header
from waiting import wait_for

from smach_oracle.msg import FailureReplay, OpenQueries
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.ros.images import colour_image

HERE = os.path.dirname(os.path.abspath(__file__))
RAW, SMALL, BROKEN = '/eye/image_raw', '/hand/image_raw/compressed', '/broken/image_raw'
SPEED = 3.0  # of simulated time
PERIOD_S = 0.05  # of all streams, wall time


class Robot:
    """A robot of its own process, with parameters."""

    def __init__(self, test, name, failures, **parameters):
        for key, value in parameters.items():
            rospy.set_param('/{}/{}'.format(name, key), value)
        self.process = subprocess.Popen(
            [
                sys.executable,
                os.path.join(HERE, 'failure_replay_robot.py'),
                str(failures),
                '__name:=' + name,
            ]
        )
        test.addCleanup(self.stop)

    def stop(self):
        if self.process.poll() is None:
            self.process.terminate()
        self.process.wait(30)


class LastSeconds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.raw = rospy.Publisher(RAW, Image, queue_size=1)
        cls.small = rospy.Publisher(SMALL, CompressedImage, queue_size=1)
        cls.broken = rospy.Publisher(BROKEN, Image, queue_size=1)
        cls.joints = rospy.Publisher('/joint_states', JointState, queue_size=1)
        cls.clock = rospy.Publisher('/clock', Clock, queue_size=1)
        cls.simulated = rospy.get_param('/use_sim_time', False)
        threading.Thread(target=cls.stream, daemon=True).start()
        wait_for(lambda: rospy.get_time() > 0, 40.0)

    @classmethod
    def stream(cls):
        chance, seconds = np.random.default_rng(1), 100.0
        while not rospy.is_shutdown():
            if cls.simulated:
                seconds += SPEED * PERIOD_S
                cls.clock.publish(rospy.Time.from_sec(seconds))
            noise = chance.integers(0, 255, (120, 160, 3), np.uint8)
            picture = cv2.resize(noise, (640, 480))
            header = Header(stamp=rospy.Time.now(), frame_id='eye')
            cls.raw.publish(colour_image(picture, header))
            jpeg = bytes(cv2.imencode('.jpg', noise)[1])
            cls.small.publish(CompressedImage(header, 'jpeg', jpeg))
            cls.broken.publish(Image(header=header, encoding='odd', width=9, height=9))
            cls.joints.publish(JointState(header, ['elbow', 'wrist'], [seconds, 0.5], [], []))
            rospy.rostime.wallsleep(PERIOD_S)  # the rate of the streams

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def bag(self):
        """The path of the bag, once the trial has ended."""
        pattern = os.path.join(self.folder, '*.bag')
        self.assertTrue(wait_for(lambda: glob.glob(pattern), 60.0))
        return glob.glob(pattern)[0]

    def read(self, name):
        """The replays of a robot's bag, and the failures that they belong to."""
        replays, failures = [], {}
        topics = ['/{}/{}'.format(name, each) for each in ('failure_replay', 'oracle/events')]
        with rosbag.Bag(self.bag()) as bag:
            for topic, message, stamp in bag.read_messages(topics=topics):
                if topic == topics[0]:
                    replays.append(message)
                    self.assertGreaterEqual(stamp, message.header.stamp)
                elif message.kind == EventKind.FAILURE:
                    failures[message.seq] = message
        return replays, failures

    def check_images(self, replay):
        at = replay.header.stamp.to_sec()
        for came, camera, image in zip(replay.images_came, replay.cameras, replay.images):
            self.assertTrue(at - replay.seconds <= came.to_sec() <= at)
            self.assertEqual(image.header.frame_id, 'eye')
            shape = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR).shape
            self.assertEqual(shape, [(240, 320, 3), (120, 160, 3)][camera])
        self.assertEqual(sorted(replay.images_came), replay.images_came)

    def test_1_a_bag_has_the_seconds_before_each_failure(self):
        Robot(self, 'alpha', 2, record=self.folder, failure_cameras=[RAW, SMALL, BROKEN])
        replays, failures = self.read('alpha')
        self.assertEqual([replay.seq for replay in replays], sorted(failures))
        self.assertEqual(len(replays), 2)
        for replay in replays:
            self.assertEqual(replay.topics, [RAW, SMALL, BROKEN])
            self.assertEqual(set(replay.cameras), {0, 1}, 'the third one sends nonsense')
            self.check_images(replay)
            self.assertEqual({tuple(each.name) for each in replay.joints}, {('elbow', 'wrist')})
            self.assertEqual((replay.text, replay.query_id, replay.events), ('', '', []))
        first, second = ({came.to_sec() for came in each.images_came} for each in replays)
        self.assertGreater(min(second), max(first), 'nothing lies in a bag twice')
        between = replays[0].joints_came
        for earlier, later in zip(between, between[1:]):
            self.assertGreater((later - earlier).to_sec(), 0.19)

    def test_2_a_bag_keeps_to_its_quota(self):
        Robot(self, 'beta', 2, record=self.folder, failure_cameras=[RAW], replay_bag_mb=0.05)
        replays, _ = self.read('beta')
        self.assertTrue(all(replay.images_left_out for replay in replays))
        self.assertIn('~replay_bag_mb allows 0.05 MB', replays[0].text)
        taken = sum(len(image.data) for replay in replays for image in replay.images)
        self.assertTrue(0 < taken <= 50000, taken)

    def test_3_a_question_comes_with_what_led_to_it(self):
        questions, told = [], []
        rospy.Subscriber('/gamma/expert_query/open', OpenQueries, questions.append)
        rospy.Subscriber('/gamma/failure_replay', FailureReplay, told.append)
        Robot(self, 'gamma', 1, failure_cameras=[SMALL], oracle={'policy': 'always_ask'})
        self.assertTrue(wait_for(lambda: questions and questions[-1].queries and told, 60.0))
        replay, query = told[-1], questions[-1].queries[0].query
        self.assertEqual((replay.query_id, replay.trial_id), (query.query_id, query.trial_id))
        self.assertTrue(len(replay.images) > 1 and len(replay.joints) > 1)
        kinds = [event.kind for event in replay.events]
        self.assertEqual((kinds[0], kinds[-1]), (EventKind.TRIAL_START, EventKind.FAILURE))
        self.assertEqual(replay.events[-1].seq, replay.seq)

    def test_4_a_robot_without_cameras_listens_to_nothing(self):
        Robot(self, 'delta', 1, record=self.folder)
        self.assertTrue(wait_for(lambda: self.system('/delta')['/delta/oracle/events']))
        self.assertNotIn('/delta/failure_replay', self.system('/delta'))
        replays, _ = self.read('delta')
        self.assertEqual(replays, [])

    def system(self, node):
        """The topics of a node: whether it publishes them."""
        publishers, subscribers, _ = rosgraph.Master('/test').getSystemState()
        self.assertNotIn(node, dict(subscribers).get('/joint_states', []))
        found = {topic: False for topic, nodes in subscribers if node in nodes}
        found.update({topic: True for topic, nodes in publishers if node in nodes})
        return {'/delta/oracle/events': False, **found}


if __name__ == '__main__':
    import rostest

    rospy.init_node('failure_replay')
    rostest.rosrun('smach_oracle', 'failure_replay', LastSeconds)
