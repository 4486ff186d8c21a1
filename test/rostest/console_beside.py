#!/usr/bin/env python3
"""A second console on one master takes another name, and the first one lives on."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import unittest
import urllib.request

import rosgraph
import rospy
import rostest
from roslib.packages import find_node

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from waiting import wait_for

from smach_oracle.experiment.launching import free_port


def served(port):
    with socket.socket() as probe:
        return probe.connect_ex(('127.0.0.1', port)) == 0


class ConsoleBesideAnother(unittest.TestCase):
    def setUp(self):
        self.processes = []

    def tearDown(self):
        for process in self.processes:
            process.kill()
            process.wait()

    def start(self, *more, env=None, stderr=None):
        port = free_port()
        command = [find_node('smach_oracle', 'expert_console')[0], '_port:={}'.format(port)]
        self.processes.append(subprocess.Popen(command + list(more), env=env, stderr=stderr))
        self.assertTrue(wait_for(lambda: served(port), 60.0))
        return port

    @staticmethod
    def names(begin):
        _, _, services = rosgraph.Master('/test').getSystemState()
        return {
            name.rsplit('/', 1)[0]
            for name, _ in services
            if name.startswith(begin) and name.endswith('/get_loggers')
        }

    def test_two_consoles_run_side_by_side(self):
        rospy.set_param('/expert_console/cameras', {'/alpha': ['/beta']})
        first = self.start('__name:=expert_console')
        # as a person starts it, and as roslaunch does
        second = self.start()
        third = self.start('__name:=expert_console')
        self.assertEqual(
            self.names('/expert_console'),
            {'/expert_console', '/expert_console_2', '/expert_console_3'},
        )
        self.assertEqual(rospy.get_param('/expert_console_3/cameras'), {'/alpha': ['/beta']})
        self.assertTrue(all(served(port) for port in (first, second, third)))
        self.assertEqual([process.poll() for process in self.processes], [None] * 3)

    def test_the_name_of_a_console_that_was_killed_is_free(self):
        self.start('__name:=killed_console')
        self.processes[0].send_signal(signal.SIGKILL)
        self.processes[0].wait()
        self.start('__name:=killed_console')
        self.assertIn('/killed_console', self.names('/killed_console'))
        self.assertNotIn('/killed_console_2', self.names('/killed_console'))

    def test_a_console_without_opencv_starts_and_says_what_it_lacks(self):
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, 'sitecustomize.py'), 'w') as file:
                file.write('import sys\nsys.modules["cv2"] = None\n')
            path = os.pathsep.join([folder, os.environ.get('PYTHONPATH', '')])
            with open(os.path.join(folder, 'log'), 'w') as log:
                port = self.start(
                    '__name:=blind_console', env=dict(os.environ, PYTHONPATH=path), stderr=log
                )
            with urllib.request.urlopen('http://127.0.0.1:{}/'.format(port), timeout=20) as page:
                self.assertIn('<html', page.read().decode())
            with open(log.name) as file:
                self.assertIn('OpenCV is missing', file.read())


if __name__ == '__main__':
    rospy.init_node('console_beside')
    rostest.rosrun('smach_oracle', 'console_beside', ConsoleBesideAnother, sys.argv)
