#!/usr/bin/env python3
"""The master dies while a robot waits for an expert at a shared server. Masters and nodes of its
own.
"""

import os
import subprocess
import sys
import time
import unittest
import xmlrpc.client

import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import Process, start_master
from waiting import wait_for

from smach_oracle.experiment.launching import free_port

SHARED = '/shared/expert_query'
RESTART_S = 8.0  # within which a master is back, also on a machine busy with other tests


class TestMasterRestart(unittest.TestCase):
    def setUp(self):
        self.port = free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI='http://localhost:{}'.format(self.port))
        self.start_master()
        self.start(Process.installed, 'expert_query_server', '__name:=shared')
        self.robot = self.start(Process.role, 'ask', SHARED, stdout=subprocess.PIPE)

    def start(self, make, *arguments, **options):
        process = make(*arguments, env=self.environment, **options)
        self.addCleanup(process.kill)
        return process

    def start_master(self):
        self.master = start_master(self.port, env=self.environment)
        self.addCleanup(self.master.kill)

    def restart_master(self):
        before = self.call('getPid')
        self.master.kill()
        self.start_master()
        # what it knows by now cannot be asserted: the nodes may have registered again before the
        # first question
        self.assertNotEqual(self.call('getPid'), before, 'the old master still answers')

    def start_expert(self, delay_s):
        self.start(
            Process.installed,
            'scripted_expert',
            '_rules:={{PICK: {{kind: goto, state: DETECT, delay_s: {}}}}}'.format(delay_s),
        )

    def subscribed(self, node, topic):
        """Whether the node listens to the server; what it has to do then takes milliseconds."""
        subscribers = dict(self.call('getSystemState')[1]).get(SHARED + topic, [])
        return any(name.startswith(node) for name in subscribers)

    @staticmethod
    def let_them_connect():
        time.sleep(1.0)  # a master does not know which of its nodes are connected

    def call(self, method):
        return getattr(xmlrpc.client.ServerProxy(self.environment['ROS_MASTER_URI']), method)(
            '/test'
        )[2]

    def test_a_front_end_started_after_the_restart_answers(self):
        self.assertTrue(wait_for(lambda: self.subscribed('/ask_', '/result'), 40.0))
        self.let_them_connect()
        self.restart_master()
        self.start_expert(0.0)
        self.assertEqual(self.robot.output(60.0)[-13:], 'answer DETECT')

    def test_a_front_end_that_lived_through_the_restart_answers(self):
        self.assertTrue(wait_for(lambda: self.subscribed('/ask_', '/result'), 40.0))
        self.start_expert(RESTART_S)
        self.assertTrue(wait_for(lambda: self.subscribed('/scripted_expert', '/open'), 40.0))
        self.let_them_connect()
        self.restart_master()
        self.assertEqual(self.robot.output(60.0)[-13:], 'answer DETECT')


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'expert_master_restart', TestMasterRestart)
