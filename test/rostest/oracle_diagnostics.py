#!/usr/bin/env python3
"""/diagnostics, roswtf and the loggers of a node whose machine asks its expert, over a real
master.
"""

import logging
import subprocess
import sys
import threading
import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from roscpp.srv import GetLoggers, SetLoggerLevel
from rosgraph_msgs.msg import Log
from waiting import wait_for

import smach
from smach_oracle import OracleContainer

# roswtf asks rosdep which packages depend on it, and this machine may have no database of rosdep.
# All the rest is roswtf's own: it reads the package's export, and loads and runs the plugin.
ROSWTF = """
import rospkg
rospkg.RosPack.get_depends_on = lambda rospack, name, implicit=True: ['smach_oracle']
import roswtf
roswtf.roswtf_main()
"""


class Fails(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'failed'])

    def execute(self, userdata):
        return 'failed'


def level_of(logger):
    answer = rospy.ServiceProxy('~get_loggers', GetLoggers)()
    return {each.name: each.level.lower() for each in answer.loggers}[logger]


class DiagnosticsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.told, cls.logged = {}, []
        rospy.Subscriber(
            '/diagnostics',
            DiagnosticArray,
            lambda message: cls.told.update({each.name: each for each in message.status}),
        )
        rospy.Subscriber('/rosout', Log, lambda message: cls.logged.append(message))
        cls.machine = smach.StateMachine(outcomes=['succeeded', 'failed'])
        with cls.machine:
            smach.StateMachine.add('PICK', Fails(), transitions={'failed': 'failed'})
        cls.oracle = OracleContainer.wrap(cls.machine, settings={'max_recoveries': 1})
        cls.thread = threading.Thread(target=cls.oracle.execute, daemon=True)
        cls.thread.start()

    @classmethod
    def tearDownClass(cls):
        cls.oracle.request_preempt()
        cls.thread.join(20.0)

    def status(self, part):
        return self.told.get('{}: oracle {}'.format(rospy.get_name().lstrip('/'), part))

    def asks(self):
        status = self.status('questions')
        return status is not None and status.level == DiagnosticStatus.WARN

    def test_an_open_question_is_a_warning_and_the_rest_is_well(self):
        self.assertTrue(wait_for(self.asks, 40.0), self.told)
        status = self.status('questions')
        self.assertEqual((status.message, status.hardware_id), ('1 open question', 'smach_oracle'))
        self.assertTrue(status.values[0].value.startswith('PICK of '), status)
        self.assertEqual(self.status('recorder').message, 'nothing is recorded')
        self.assertEqual(self.status('store').level, DiagnosticStatus.OK)
        self.assertIsNotNone(self.status('states'))

    def test_roswtf_loads_the_plugin_and_names_the_question(self):
        self.assertTrue(wait_for(self.asks, 40.0), self.told)
        told = subprocess.run(
            [sys.executable, '-c', ROSWTF],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=100,
            check=False,
        ).stdout.decode()
        self.assertIn('Loaded plugin smach_oracle.ros.diagnostics.roswtf_plugin', told)
        self.assertIn('oracles need a person', told)
        self.assertIn('1 open question', told)

    def test_the_levels_of_the_standard_services_apply_to_what_the_executive_logs(self):
        self.assertTrue(wait_for(self.asks, 40.0), self.told)
        self.assertTrue(
            wait_for(lambda: any('PICK failed' in each.msg for each in self.logged), 10.0)
        )
        set_level = rospy.ServiceProxy('~set_logger_level', SetLoggerLevel)
        set_level('rosout', 'error')
        self.addCleanup(set_level, 'rosout', 'info')
        self.assertEqual(level_of('rosout'), 'error')
        before = len(self.logged)
        smach.loginfo('not to be seen')
        smach.logwarn('nor this')
        smach.logerr('this is seen')
        self.assertTrue(wait_for(lambda: len(self.logged) > before, 10.0))
        told = [each.msg for each in self.logged[before:]]
        self.assertIn('this is seen', told)
        self.assertFalse({'not to be seen', 'nor this'} & set(told))
        self.assertEqual(logging.getLogger('rosout').level, logging.ERROR)


if __name__ == '__main__':
    rospy.init_node('oracle_diagnostics')
    rostest.rosrun('smach_oracle', 'oracle_diagnostics', DiagnosticsTest, sys.argv)
