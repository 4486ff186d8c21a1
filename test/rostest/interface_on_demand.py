#!/usr/bin/env python3
"""Interfaces that are started when an expert chooses them: the documentation's own example, and
starts that fail.
"""

import os
import re
import shutil
import sys
import tempfile
import threading
import unittest

import rosgraph
import rospkg
import rospy
import rostest
import yaml

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import make_question
from waiting import wait_for

from smach_oracle.msg import InterfaceOutput
from smach_oracle.oracle.errors import InterfaceError
from smach_oracle.oracle.settings.settings import Settings
from smach_oracle.ros.expert.client import ExpertQueryClient
from smach_oracle.ros.service_calls import ServerGoneError, call_service
from smach_oracle.srv import FinishInterface, FinishInterfaceRequest

PAGE = os.path.join(rospkg.RosPack().get_path('smach_oracle'), 'doc', 'own_interface.md')
LAUNCH = (
    '<launch><node pkg="my_robot" type="my_interface.py" name="by_hand" output="screen"/></launch>'
)
BROKEN = '#!/bin/sh\necho it has no camera >&2\nexit 5\n'
IDLE = '#!/bin/sh\nexec sleep 600\n'
SEVERAL = """#!/usr/bin/env python3
import threading
import actionlib
import rospy
from smach_oracle.msg import SharedAutonomyAction, SharedAutonomyResult

def work(goal):
    goal.set_accepted()
    seconds = 2.0 if goal.get_goal().query_id == 'long' else 0.5
    result = SharedAutonomyResult(outcome='succeeded')
    threading.Timer(seconds, goal.set_succeeded, [result]).start()

rospy.init_node('several')
actionlib.ActionServer('/several', SharedAutonomyAction, work, auto_start=False).start()
rospy.spin()
"""


def blocks(language):
    """The fenced blocks of a language on the page."""
    with open(PAGE) as file:
        return re.findall('```{}\n(.*?)```'.format(language), file.read(), re.S)


class InterfaceOnDemand(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        package = os.path.join(cls.folder, 'my_robot')
        os.mkdir(package)
        files = {
            'package.xml': '<package><name>my_robot</name><version>1.0.0</version>'
            '<description>x</description>'
            '<maintainer email="a@b.c">a</maintainer><license>BSD</license></package>',
            'my_interface.py': blocks('python')[0],
            'by_hand.launch': LAUNCH,
            'broken': BROKEN,
            'idle': IDLE,
            'several': SEVERAL,
        }
        for name, text in files.items():
            with open(os.path.join(package, name), 'w') as file:
                file.write(text)
            os.chmod(os.path.join(package, name), 0o755)
        os.environ['ROS_PACKAGE_PATH'] = cls.folder + ':' + os.environ['ROS_PACKAGE_PATH']
        cls.client = ExpertQueryClient(server_wait_s=3.0)
        cls.told = []
        rospy.Subscriber(rospy.resolve_name('~interface_output'), InterfaceOutput, cls.told.append)

    @classmethod
    def tearDownClass(cls):
        cls.client.close()
        shutil.rmtree(cls.folder)

    def offer(self, **changes):
        given = yaml.safe_load(blocks('yaml')[-1])['expert']['interfaces']['by_hand']
        entry = dict(given, **changes)
        entry = {key: value for key, value in entry.items() if value is not None}
        return Settings.from_dict({'expert': {'interfaces': {'by_hand': entry}}}).offers_for(
            '', 'PICK'
        )[0]

    def run_interface(self, offer, work):
        """Run it while a person works in a thread; the answer. Nobody waits on when the person has
        gone.
        """
        del self.told[:]
        gone = threading.Event()
        thread = threading.Thread(target=self.at_work, args=(work, gone))
        thread.start()
        try:
            return self.client.run_interface(
                offer, make_question(self.id(), output_keys=('cup',)), gone, lambda *what: None
            )
        finally:
            thread.join()

    @staticmethod
    def at_work(work, gone):
        if not work():
            gone.set()

    def said(self, text):
        return wait_for(
            lambda: any(text in line for told in list(self.told) for line in told.lines), 60.0
        )

    def finish(self):
        """What a front end does: as soon as the interface has said that it is ready. Whether it has
        done so.
        """

        def finished():
            try:
                return call_service(
                    '/by_hand/finish', FinishInterface, FinishInterfaceRequest(outcome='succeeded')
                ).ok
            except ServerGoneError:
                return False

        self.seen = bool(self.said('Now do the work of PICK'))
        return self.seen and bool(wait_for(finished, 30.0))

    def assert_gone(self):
        self.assertTrue(self.client._starter._last['by_hand'].ended(25.0), 'nothing of it is left')

    def assert_works(self, offer):
        answer = self.run_interface(offer, self.finish)
        self.assertTrue(self.seen, 'what it prints is told')
        self.assertIsNotNone(answer, 'it is finished')
        self.assertEqual((answer.outcome, answer.outputs), ('succeeded', {'cup': 'on the table'}))
        self.assert_gone()
        self.assertEqual(self.told[-1].status, InterfaceOutput.STOPPED)

    def test_the_example_of_the_documentation_does_the_work_and_is_gone_afterwards(self):
        self.assert_works(self.offer())
        self.assertTrue(
            wait_for(
                lambda: '/by_hand/status' not in dict(rosgraph.Master('/t').getPublishedTopics(''))
            ),
            'it ended in order',
        )

    def test_so_does_a_launch_file(self):
        self.assert_works(self.offer(node=None, launch='my_robot/by_hand.launch'))

    def assert_fails(self, offer, *texts):
        with self.assertRaises(InterfaceError) as raised:
            self.run_interface(offer, lambda: True)
        for text in texts:
            self.assertIn(text, str(raised.exception))
        self.assertTrue(
            wait_for(lambda: self.told and self.told[-1].status == InterfaceOutput.FAILED)
        )
        self.assertEqual(self.told[-1].text, str(raised.exception))

    def test_a_start_that_fails_is_said_with_its_last_words(self):
        self.assert_fails(self.offer(node='my_robot broken'), 'exit code 5', 'it has no camera')
        self.assert_fails(
            self.offer(node='my_robot nothing'), 'there is no node nothing in package my_robot'
        )
        self.assert_fails(self.offer(node='no_robot nothing'), 'there is no package no_robot')

    def test_what_never_brings_up_its_server_is_ended(self):
        self.assert_fails(
            self.offer(node='my_robot idle', start_limit_s=1.5),
            'no action server /by_hand within 1.5 s',
        )
        self.assert_gone()

    def test_two_questions_share_one_and_the_first_that_ends_does_not_stop_it(self):
        offer = self.offer(node='my_robot several', action='/several')
        answers = {}

        def run(query_id):
            answers[query_id] = self.client.run_interface(
                offer, make_question(query_id), threading.Event(), lambda *what: None
            )

        threads = [threading.Thread(target=run, args=(each,)) for each in ('short', 'long')]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60.0)
        self.assertEqual(
            {query_id: answer.outcome for query_id, answer in answers.items()},
            {'short': 'succeeded', 'long': 'succeeded'},
        )
        run('short again')  # while it is being stopped
        self.assertEqual(answers['short again'].outcome, 'succeeded')
        self.assert_gone()

    def test_one_that_nobody_can_start_is_waited_for_only_so_long(self):
        with self.assertRaises(InterfaceError) as raised:
            self.run_interface(self.offer(node=None), lambda: True)
        self.assertIn('no action server at /by_hand within 3 s', str(raised.exception))


if __name__ == '__main__':
    rospy.init_node('interface_on_demand')
    rostest.rosrun('smach_oracle', 'interface_on_demand', InterfaceOnDemand)
