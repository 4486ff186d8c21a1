#!/usr/bin/env python3
"""A killed and resumed program: its bags are one trial, an earlier moment, roslaunch's respawn."""

import glob
import json
import os
import shutil
import signal
import subprocess
import tempfile
import xmlrpc.client

import rosbag
import rosgraph
import rospy
import rostest
from oracle_support import FrontEnd, Process, script
from smach_ros_action_node import Behaviour
from survive_support import EXPERTS, SurvivingCase, Traffic
from waiting import wait_for

from smach_oracle.msg import ExpertDecision, OracleEvent
from smach_oracle.ros.recording.bag_repair import recover_folder
from smach_oracle.srv import AnswerQueryRequest
from smach_oracle.store.store_file import StoreFile

LAUNCH = """
<launch>
  <node pkg="smach_oracle" type="oracle_run" name="task" respawn="true" output="screen"
        args="--checkpoint {store} {script} {goal} succeeded">
    <param name="expert_query_server" value="{experts}"/>
  </node>
</launch>
"""


class PartsTest(SurvivingCase):
    def test_the_bags_of_both_parts_are_one_trial(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        task, _ = self.run_until_it_moves('--record', folder.name)
        self.assertTrue(wait_for(lambda: 'MOVE' in entered(folder.name), 20.0))
        self.kill(task)
        again = self.run_task('--resume', '--record', folder.name)
        self.assertTrue(again.says('OUTCOME succeeded', 60.0), again.output())
        self.assertEqual(again.wait(), 0, again.output())
        done = subprocess.run(
            ['rosrun', 'smach_oracle', 'bag_statistics', folder.name, '--json', 'out.json'],
            cwd=folder.name,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=60,
            universal_newlines=True,
        )
        self.assertEqual(done.returncode, 0, done.stdout)
        with open(os.path.join(folder.name, 'out.json')) as stream:
            told = json.load(stream)
        (trial,) = told['trials']
        self.assertEqual(
            (trial['resumed'], trial['lost_events'], trial['ending']), (1, 0, 'success')
        )
        self.assertEqual(len(trial['bags']), 2)
        self.assertTrue(0 < trial['down_s'] < trial['duration_s'])
        self.assertIn('1 trials were resumed after their program was stopped', done.stdout)

    def test_it_goes_on_from_an_earlier_moment(self):
        task, _ = self.run_until_it_moves()
        self.kill(task)
        store = StoreFile(self.store, read_only=True)
        moment = next(
            each.number
            for each in store.moments(1)
            if (each.kind, each.label) == ('STATE_START', 'LOOK')
        )
        again = self.run_task('--from', str(moment))
        self.assertTrue(again.says('OUTCOME succeeded', 60.0), again.output())
        self.assertIn('from moment {}'.format(moment), again.output())
        self.assertIn('LOOKS', again.output())
        refused = self.run_task('--from', '999999')
        self.assertEqual(refused.wait(40.0), 2, refused.output())
        self.assertIn('checkpoint.from: 999999', refused.output())

    def test_a_program_that_roslaunch_begins_again_asks_before_it_moves(self):
        expert, traffic = FrontEnd(self, EXPERTS), Traffic(self)
        launch = script(
            self,
            LAUNCH.format(
                store=self.store, script=self.script, goal=Behaviour.HANG, experts=EXPERTS
            ),
            'task.launch',
        )
        roslaunch = Process(['roslaunch', '--wait', launch])
        self.addCleanup(roslaunch.stop)
        self.addCleanup(end, roslaunch)
        self.assertTrue(wait_for(lambda: traffic.active, 60.0), roslaunch.output())
        before = set(traffic.active)
        os.kill(int(pid_of('/task')), signal.SIGKILL)
        entry = expert.question(60.0, 'MOVE')
        self.assertIsNotNone(entry, roslaunch.output())
        self.assertIn('the program was stopped', str(entry.query))
        self.assertEqual(traffic.active, before)
        self.assertEqual(roslaunch.output().count('LOOKS'), 1)
        reply = expert.answer(
            AnswerQueryRequest(
                query_id=entry.query.query_id,
                decision=ExpertDecision(kind=ExpertDecision.GOTO, state='TELL', by='Ann'),
            )
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(roslaunch.says('OUTCOME succeeded', 40.0), roslaunch.output())
        self.assertEqual(traffic.active, before)


def entered(folder):
    """The states that a trial has entered, as its bag would say if the program were killed now."""
    with tempfile.TemporaryDirectory() as copies:
        for path in glob.glob(os.path.join(folder, '*.bag.active')):
            shutil.copy(path, copies)
        found = []
        for path in recover_folder(copies, lambda text: None, lambda text: None):
            with rosbag.Bag(path) as bag:
                found += [
                    event.state
                    for _, event, _ in bag.read_messages('/task/oracle/events')
                    if event.kind == OracleEvent.STATE_START
                ]
        return found


def pid_of(node):
    """The number of the process of a node."""
    uri = rosgraph.Master('/survive_parts').lookupNode(node)
    with xmlrpc.client.ServerProxy(uri) as proxy:
        return proxy.getPid('/survive_parts')[2]


def end(roslaunch):
    """Have roslaunch end its nodes."""
    if roslaunch.running():
        roslaunch.signal(signal.SIGINT)
        roslaunch.wait(40.0)


if __name__ == '__main__':
    rospy.init_node('survive_parts')
    rostest.rosrun('smach_oracle', 'survive_parts', PartsTest)
