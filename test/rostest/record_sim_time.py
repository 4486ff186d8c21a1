#!/usr/bin/env python3
"""A recorder under simulated time: its bags bear it, and a paused simulation does not stop them
from being written.
"""

import glob
import os
import shutil
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import List

import rosbag
import rospy
from rosgraph_msgs.msg import Clock
from waiting import wait_for

from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder

WAIT_S = 20.0


class RecordSimTime(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.clock = rospy.Publisher('/clock', Clock, queue_size=10)

    def setUp(self) -> None:
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.recorder = TrialRecorder(self.folder)
        self.addCleanup(self.recorder.close)
        self.source = EventSource(rospy.logerr)
        self.recorder.attach(self.source)
        self.source.begin_trial('t')

    def set_clock(self, seconds: int) -> None:
        self.assertTrue(
            wait_for(
                lambda: (
                    self.clock.publish(rospy.Time(seconds))
                    or rospy.get_rostime() == rospy.Time(seconds)
                ),
                WAIT_S,
            )
        )

    def bag_files(self, pattern: str) -> List[str]:
        return glob.glob(os.path.join(self.folder, pattern))

    def written(self, text: bytes) -> bool:
        """Whether the bag that is being written has this text in it."""
        return any(text in Path(path).read_bytes() for path in self.bag_files('*.bag.active'))

    def stamps(self) -> List[float]:
        self.assertTrue(self.recorder.close(WAIT_S))
        (path,) = self.bag_files('*.bag')
        with rosbag.Bag(path) as bag:
            return [
                item.timestamp.to_sec()
                for item in bag.read_messages(topics=['/record_sim_time/oracle/events'])
            ]

    def test_1_before_the_clock_runs_a_bag_has_wall_time(self) -> None:
        self.assertEqual(rospy.get_rostime(), rospy.Time(0))
        self.source.emit(EventKind.TRIAL_START, 'TOP')
        self.set_clock(50)
        self.source.emit(EventKind.TRIAL_END, 'TOP')
        self.assertTrue(all(abs(stamp - time.time()) < 60 for stamp in self.stamps()))

    def test_2_a_bag_has_simulated_time_also_when_it_jumps_back(self) -> None:
        for seconds, kind in (
            (100, EventKind.TRIAL_START),
            (130, EventKind.STATE_START),
            (120, EventKind.STATE_START),
            (140, EventKind.TRIAL_END),
        ):
            self.set_clock(seconds)
            self.source.emit(kind, 'TOP')
        # rosbag reads by stamp within a chunk, and chunks as they were written
        self.assertEqual(sorted(self.stamps()), [100, 120, 130, 140])

    def test_3_events_are_written_while_the_simulation_is_paused(self) -> None:
        self.set_clock(200)
        self.source.emit(EventKind.TRIAL_START, 'TOP')
        self.assertTrue(wait_for(lambda: self.written(b'/oracle/events'), WAIT_S))
        self.source.emit(EventKind.WARNING, 'TOP', text='written while time stands still')
        self.assertTrue(wait_for(lambda: self.written(b'stands still'), 10.0))
        self.assertEqual(self.stamps(), [200, 200])


if __name__ == '__main__':
    import rostest

    rospy.init_node('record_sim_time')
    rostest.rosrun('smach_oracle', 'record_sim_time', RecordSimTime, sys.argv)
