#!/usr/bin/env python3
"""The documentation's test of a user's own script, in a package of its own.

It passes, and fails where it should.
"""

import os
import re
import shutil
import subprocess
import tempfile
import unittest

import roslib.packages
import rostest

MANIFEST = '<package><name>my_robot</name></package>'
TASK = """
import sys
import rospy
import smach

class Pick(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'], output_keys=['grasp'])

    def execute(self, userdata):
        return 'aborted'

class Place(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'], input_keys=['grasp'])

    def execute(self, userdata):
        return 'succeeded' if userdata.grasp == 'from above' else 'aborted'

rospy.init_node('task')
machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
with machine:
    smach.StateMachine.add('PICK', Pick(), {'succeeded': 'PLACE'})
    smach.StateMachine.add('PLACE', Place())
print('It ended in', machine.execute())
"""


def documented():
    """The files that the page has for `my_robot`, by name."""
    with open(
        os.path.join(roslib.packages.get_pkg_dir('smach_oracle'), 'doc', 'own_rostest.md'),
        encoding='utf-8',
    ) as page:
        return dict(
            re.findall(r'^`(test/\S+)`[^\n]*\n\n```\w+\n(.*?)```', page.read(), re.M | re.S)
        )


class OwnScript(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        for name, content in dict(
            documented(), **{'package.xml': MANIFEST, 'scripts/task.py': TASK}
        ).items():
            self.write(name, content)

    def write(self, name, content):
        path = os.path.join(self.folder, 'my_robot', name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, 'w', encoding='utf-8') as file:
            file.write(content)
        os.chmod(path, 0o755)

    def rostest(self):
        """How rostest ends; it has a master of its own, on a free port."""
        environment = dict(
            os.environ,
            ROS_HOME=self.folder,
            ROS_TEST_RESULTS_DIR=self.folder,
            ROS_LOG_DIR=self.folder,
            ROS_PACKAGE_PATH=self.folder + os.pathsep + os.environ['ROS_PACKAGE_PATH'],
        )
        return subprocess.run(
            ['rostest', 'my_robot', 'task.test'], env=environment, timeout=100
        ).returncode

    def test_it_passes_with_the_rule_and_fails_without(self):
        self.assertEqual(
            set(documented()), {'test/task.test', 'test/task_rules.yaml', 'test/task_test.py'}
        )
        self.assertEqual(self.rostest(), 0)
        self.write('test/task_rules.yaml', 'default: {kind: give_up}')
        self.assertNotEqual(self.rostest(), 0)


if __name__ == '__main__':
    rostest.rosrun('smach_oracle', 'expert_own_script', OwnScript)
