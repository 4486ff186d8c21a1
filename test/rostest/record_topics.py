#!/usr/bin/env python3
"""A recorder in a node: other topics, names, status; and the bags in the hands of rosbag's own
tools.
"""

import glob
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest
from pathlib import Path
from typing import Any, Callable, List

import rosbag
import rospy
import waiting
from std_msgs.msg import Int32, String

from smach_oracle.msg import OracleEvent, OracleRates, RecorderStatus
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder

WAIT_S = 40.0


def wait_for(condition: Callable[[], Any], what: str) -> None:
    assert waiting.wait_for(condition, WAIT_S), 'waited in vain for {}'.format(what)


class RecordTopics(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.source = EventSource(rospy.logerr)

    def start(self, *topics: str, **snapshots: Any) -> TrialRecorder:
        recorder = TrialRecorder(self.folder, topics)
        self.addCleanup(recorder.close)
        recorder.attach(self.source, {'~oracle/' + name: take for name, take in snapshots.items()})
        return recorder

    def begin(self) -> None:
        self.source.begin_trial('t')
        self.source.emit(EventKind.TRIAL_START, 'TOP', data={'recovers': True})

    def end(self, recorder: TrialRecorder) -> str:
        self.source.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded')
        self.assertTrue(recorder.close(WAIT_S))
        (path,) = glob.glob(os.path.join(self.folder, '*.bag'))
        return path

    def wait_until_written(self, text: bytes) -> None:
        """Until the bag that is being written has this text in it."""
        pattern = os.path.join(self.folder, '*.bag.active')
        wait_for(
            lambda: any(text in Path(path).read_bytes() for path in glob.glob(pattern)),
            '{!r} in the bag'.format(text),
        )

    def read(self, path: str, topic: str) -> List[Any]:
        with rosbag.Bag(path) as bag:
            return [item.message for item in bag.read_messages(topics=[topic])]

    def check_with_own_subscriber(self, topic: str, subscribe_first: bool) -> None:
        """The robot's callback and the bag both get what is published in this very process."""
        received: List[str] = []

        def robots_own(message: String) -> None:
            received.append(message.data)

        publisher = rospy.Publisher(topic, String, queue_size=10)
        if subscribe_first:
            rospy.Subscriber(topic, String, robots_own)
        recorder = self.start(topic)
        if not subscribe_first:
            rospy.Subscriber(topic, String, robots_own)
        wait_for(publisher.get_num_connections, 'the connection to ' + topic)
        self.begin()
        for number in range(5):
            publisher.publish('hello {}'.format(number))
        wait_for(lambda: len(received) == 5, "the robot's own callback")
        self.wait_until_written(b'hello 4')
        self.assertEqual(
            [message.data for message in self.read(self.end(recorder), topic)], received
        )

    def test_a_topic_that_the_node_subscribes_to_already(self) -> None:
        self.check_with_own_subscriber('/subscribed_before', True)

    def test_a_topic_that_the_node_subscribes_to_later(self) -> None:
        self.check_with_own_subscriber('/subscribed_after', False)

    def test_a_topic_of_another_process_that_appears_in_mid_trial(self) -> None:
        recorder = self.start('/late')
        self.begin()
        other = subprocess.Popen(['rostopic', 'pub', '-r', '20', '/late', 'std_msgs/Int32', '41'])
        try:
            rospy.Subscriber('/late', Int32, self.count)
            wait_for(lambda: self.counted >= 30, 'messages of another process')
        finally:
            other.terminate()
            other.wait()
        found = self.read(self.end(recorder), '/late')
        self.assertGreaterEqual(len(found), 5)
        self.assertEqual({message.data for message in found}, {41})

    counted = 0

    def count(self, _: Int32) -> None:
        self.counted += 1

    def test_a_latched_topic_is_in_every_bag(self) -> None:
        publisher = rospy.Publisher('/map_name', String, latch=True, queue_size=1)
        publisher.publish('kitchen')
        recorder = self.start('/map_name')
        wait_for(publisher.get_num_connections, 'the connection')
        self.begin()
        self.wait_until_written(b'kitchen')  # before this trial or in it
        self.source.emit(EventKind.TRIAL_END, 'TOP')
        for _ in range(2):
            self.begin()
            self.source.emit(EventKind.TRIAL_END, 'TOP')
        recorder.close(WAIT_S)
        bags = glob.glob(os.path.join(self.folder, '*.bag'))
        self.assertEqual(len(bags), 3)
        for path in bags:
            self.assertEqual(
                [message.data for message in self.read(path, '/map_name')], ['kitchen']
            )

    def test_a_message_on_its_way_at_the_end_is_in_the_bag(self) -> None:
        report = rospy.Publisher('/report', String, queue_size=10)
        mood = rospy.Publisher('/mood', String, latch=True, queue_size=10)
        recorder = self.start('/report', '/mood')
        for publisher in (report, mood):
            wait_for(publisher.get_num_connections, 'the connection')
        self.begin()
        self.source.emit(EventKind.TRIAL_END, 'TOP')
        report.publish('on its way')
        mood.publish('of the next trial')
        recorder.close(WAIT_S)
        (path,) = glob.glob(os.path.join(self.folder, '*.bag'))
        self.assertEqual([message.data for message in self.read(path, '/report')], ['on its way'])
        self.assertEqual(self.read(path, '/mood'), [])

    def test_the_next_trial_closes_the_bag_of_the_last_at_once(self) -> None:
        report = rospy.Publisher('/reports', String, queue_size=10)
        recorder = self.start('/reports')
        wait_for(report.get_num_connections, 'the connection')
        self.begin()
        self.source.emit(EventKind.TRIAL_END, 'TOP')
        self.begin()
        report.publish('of the second')
        self.wait_until_written(b'of the second')
        self.source.emit(EventKind.TRIAL_END, 'TOP')
        recorder.close(WAIT_S)
        first, second = sorted(glob.glob(os.path.join(self.folder, '*.bag')))
        self.assertEqual(
            [message.data for message in self.read(second, '/reports')], ['of the second']
        )
        self.assertEqual(self.read(first, '/reports'), [])

    def test_the_recorders_own_topics_are_relative_to_the_node(self) -> None:
        recorder = self.start(rates=lambda: OracleRates(trial_id='t'))
        self.begin()
        path = self.end(recorder)
        with rosbag.Bag(path) as bag:
            topics = {
                name: info.msg_type for name, info in bag.get_type_and_topic_info().topics.items()
            }
        self.assertEqual(
            topics,
            {
                '/record_topics/oracle/events': 'smach_oracle/OracleEvent',
                '/record_topics/oracle/rates': 'smach_oracle/OracleRates',
                '/record_topics/record/status': 'smach_oracle/RecorderStatus',
            },
        )

    def test_events_bear_the_time_of_their_step(self) -> None:
        recorder = self.start()
        before = rospy.get_rostime()
        self.begin()
        after = rospy.get_rostime()
        self.wait_until_written(b'recovers')
        with rosbag.Bag(self.end(recorder)) as bag:
            event, message, stamp = next(bag.read_messages(topics=['/record_topics/oracle/events']))
        self.assertTrue(before <= message.header.stamp <= after)
        self.assertEqual(message.header.stamp, stamp)

    def test_the_operator_is_told_of_a_failing_disk(self) -> None:
        told: List[int] = []
        recorder = self.start()
        rospy.Subscriber(
            '/record_topics/record/status',
            RecorderStatus,
            lambda message: told.append(message.state),
        )
        self.begin()
        wait_for(lambda: RecorderStatus.RECORDING in told, 'the status of recording')
        shutil.rmtree(self.folder)
        self.source.emit(EventKind.TRIAL_END, 'TOP')
        wait_for(lambda: RecorderStatus.DROPPING in told, 'the status of dropping')
        late: List[RecorderStatus] = []
        rospy.Subscriber('/record_topics/record/status', RecorderStatus, late.append)  # latched
        wait_for(lambda: late, 'the latched status')
        self.assertEqual(late[0].events_lost_in_total, 2)
        self.assertIn(self.folder, late[0].text)
        recorder.close(WAIT_S)

    def test_rosbag_info_and_play_understand_a_bag(self) -> None:
        recorder = self.start()
        self.begin()
        for number in range(20):
            self.source.emit(EventKind.STATE_START, 'TOP', state='S{}'.format(number))
        path = self.end(recorder)
        info = subprocess.run(
            ['rosbag', 'info', path], check=True, stdout=subprocess.PIPE, universal_newlines=True
        )
        self.assertIn('22 msgs', info.stdout)
        played: List[int] = []
        done = threading.Event()

        def receive(message: OracleEvent) -> None:
            played.append(message.seq)
            if message.kind == OracleEvent.TRIAL_END:
                done.set()

        rospy.Subscriber('/record_topics/oracle/events', OracleEvent, receive)
        subprocess.run(
            [
                'rosbag',
                'play',
                '-q',
                '--wait-for-subscribers',
                path,
                '--topics',
                '/record_topics/oracle/events',
            ],
            check=True,
            timeout=WAIT_S,
        )
        self.assertTrue(done.wait(WAIT_S))
        self.assertEqual(played, list(range(22)))


if __name__ == '__main__':
    import rostest

    rospy.init_node('record_topics')
    rostest.rosrun('smach_oracle', 'record_topics', RecordTopics, sys.argv)
