#!/usr/bin/env python3
"""The simulated PR2 as a process: how it begins, keeps the wall's time, and ends with its last
words written.
"""

import json
import os
import signal
import sys
import tempfile
import threading
import time
import unittest
from typing import Any, Dict, List

import rospy
from oracle_support import Process
from sensor_msgs.msg import Image
from waiting import wait_for

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.pr2.robot import RobotError
from smach_oracle.pr2.ros_robot import RosRobot
from smach_oracle.srv import ResetWorld

LIMIT_S = 40.0
RUN = 'from smach_oracle.simulation.node.main import main; main()'
# as on a machine with so much to do that the world's thread does not get on
BUSY = """
import time
from smach_oracle.simulation.node import main
judge = main.judge
main.judge = lambda *of: time.sleep(4.0) or judge(*of)
main.main()
"""


class Pr2WorldProcess(unittest.TestCase):
    """Each test has a world of its own."""

    def setUp(self) -> None:
        handle, self.truth = tempfile.mkstemp(suffix='.jsonl')
        os.close(handle)
        self.addCleanup(os.unlink, self.truth)

    def world(self, run: str = RUN, **parameters: Any) -> Process:
        # a name of its own: a master keeps the parameters of nodes that have ended
        arguments = ['__name:=world_of_' + self._testMethodName, '_truth_file:=' + self.truth]
        arguments += ['_{}:={}'.format(*parameter) for parameter in parameters.items()]
        process = Process([sys.executable, '-c', run] + arguments)
        self.addCleanup(process.stop)
        return process

    def reset(self, seed: int) -> None:
        rospy.wait_for_service('world/reset', LIMIT_S)
        self.assertTrue(rospy.ServiceProxy('world/reset', ResetWorld)(seed).ok)

    def lines(self) -> List[Dict[str, Any]]:
        with open(self.truth, encoding='utf-8') as file:
            return [json.loads(line) for line in file]

    def ends(self, process: Process, number: int) -> None:
        began = time.monotonic()
        process.signal(number)
        self.assertIn(process.wait(LIMIT_S), (0, 128 + number, -number), process.output())
        # 2 s, where nothing else keeps the machine busy
        self.assertLess(time.monotonic() - began, 6.0)
        self.assertNotIn('Traceback', process.output())

    def test_sigterm_in_the_middle_of_a_motion_leaves_a_line_on_each_trial(self) -> None:
        process = self.world(benign=True)
        self.reset(1)
        self.reset(2)
        robot = RosRobot(timeout_s=LIMIT_S)
        robot.joints()
        refused: List[str] = []

        def drive() -> None:
            try:
                robot.drive(from_rpy((-5.0, 0.0, 0.0)))  # 20 s
            except RobotError as err:
                refused.append(str(err))

        driver = threading.Thread(target=drive)
        driver.start()
        self.assertTrue(wait_for(lambda: robot.odom_from_base()[0, 3] < -0.02, LIMIT_S))
        self.ends(process, signal.SIGTERM)
        driver.join(LIMIT_S)
        self.assertEqual(len(refused), 1)
        self.assertEqual(
            [(line['seed'], line['task'], line['success']) for line in self.lines()],
            [(1, 'pick_and_place', False), (2, 'pick_and_place', False)],
        )
        self.assertEqual(self.lines()[0]['sim_s'], 0.0)
        self.assertTrue(0.3 < self.lines()[1]['sim_s'] < 20.0)

    def test_the_last_line_is_waited_for_on_a_busy_machine(self) -> None:
        process = self.world(run=BUSY, benign=True)
        self.reset(1)
        process.signal(signal.SIGINT)
        process.wait(LIMIT_S)
        self.assertEqual([line['seed'] for line in self.lines()], [1], process.output())

    def test_a_world_without_a_trial_has_no_truth_to_tell(self) -> None:
        process = self.world()
        self.assertTrue(process.says('ready for pick_and_place', LIMIT_S))
        self.ends(process, signal.SIGINT)
        self.assertEqual(self.lines(), [])

    def test_a_paced_world_keeps_the_walls_time_and_streams_its_camera(self) -> None:
        process = self.world(real_time_factor=1, camera_rate=2, benign=True)
        images: List[Image] = []
        rospy.Subscriber('head_camera/rgb/image_raw', Image, images.append)
        self.assertTrue(wait_for(lambda: len(images) >= 2, LIMIT_S), process.output())
        # it may fall behind on a busy machine; it never runs ahead
        wall, sim = time.monotonic(), rospy.get_time()
        self.assertTrue(wait_for(lambda: rospy.get_time() - sim > 5.0, LIMIT_S))
        self.assertGreater(time.monotonic() - wall, 4.4)  # it catches up on 0.25 s at the most
        self.reset(3)
        self.ends(process, signal.SIGTERM)
        self.assertEqual(len(self.lines()), 1)

    def test_a_bad_parameter_ends_it_in_words(self) -> None:
        process = self.world(task='dance')
        self.assertEqual(process.wait(LIMIT_S), 2)
        self.assertIn(
            "~task: 'dance' is not allowed; allowed: pick_and_place, drink_retrieval",
            process.output(),
        )


if __name__ == '__main__':
    import rostest

    rospy.init_node('pr2_world_process')
    rostest.rosrun('smach_oracle', 'pr2_world_process', Pr2WorldProcess)
