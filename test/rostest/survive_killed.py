#!/usr/bin/env python3
"""A script under oracle_run is killed with SIGKILL, and run again: it goes on where it stood."""
import os
import signal
import tempfile
import unittest

import rospy
import rostest
from actionlib.msg import TestActionResult
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from oracle_support import EventLog, FrontEnd, oracle_run, script
from smach_ros_action_node import Behaviour
from smach_ros_support import ActionNodeProcess
from waiting import wait_for

from smach_oracle.msg import ExpertDecision, OracleEvent
from smach_oracle.ros.expert.server import ExpertQueryServer
from smach_oracle.srv import AnswerQueryRequest

SCRIPT = '''
import sys, numpy, rospy, smach, smach_ros
from actionlib.msg import TestAction, TestGoal
from geometry_msgs.msg import PointStamped
rospy.init_node('task')
class Look(smach.State):
    def __init__(self):
        smach.State.__init__(self, ['succeeded'], [], ['seen', 'image'])
    def execute(self, userdata):
        print('LOOKS', flush=True)
        seen = PointStamped()
        seen.point.x = 1.5
        userdata.seen = seen
        userdata.image = numpy.arange(6).reshape(2, 3)
        return 'succeeded'
class Tell(smach.State):
    def __init__(self):
        smach.State.__init__(self, ['succeeded', 'aborted'], ['seen', 'image'])
    def execute(self, userdata):
        print('SEEN', userdata.seen.point.x, userdata.image.tolist(), flush=True)
        return sys.argv[2]
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('LOOK', Look(), {'succeeded': 'MOVE'})
    smach.StateMachine.add('MOVE', smach_ros.SimpleActionState(
        'arm', TestAction, goal=TestGoal(int(sys.argv[1]))), {'succeeded': 'TELL'})
    smach.StateMachine.add('TELL', Tell())
print('OUTCOME', sm.execute(), flush=True)
'''
SUCCEED = 150  # number of a goal
EXPERTS = '/experts'
ASKS = 'max_recoveries: 0\npolicy: prose\n'


class Traffic:
    """What the action server, which is never killed, says of its goals."""

    def __init__(self, test):
        self.results = []
        self.active = set()  # ids of all that ever were
        for end, kind, note in (('status', GoalStatusArray, self._status),
                                ('result', TestActionResult, self.results.append)):
            subscriber = rospy.Subscriber('/arm/' + end, kind, note, queue_size=10)
            test.addCleanup(subscriber.unregister)
            test.assertTrue(wait_for(subscriber.get_num_connections))

    def _status(self, message):
        self.active.update(each.goal_id.id for each in message.status_list
                           if each.status == GoalStatus.ACTIVE)


class KilledTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = ActionNodeProcess('arm').start()
        cls.experts = ExpertQueryServer(EXPERTS)

    @classmethod
    def tearDownClass(cls):
        cls.server.stop()
        cls.experts.stop()

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.store = os.path.join(folder.name, 'robot.db')
        self.script = script(self, SCRIPT)
        for name in ('checkpoint', 'expert_query_server'):  # of an earlier process
            if rospy.has_param('/task/' + name):
                rospy.delete_param('/task/' + name)
        self.settings = script(self, ASKS, 'oracle.yaml')

    def run_task(self, *words, goal=SUCCEED, told='succeeded'):
        return oracle_run(self, '--checkpoint', self.store, *words, self.script, str(goal), told,
                          '_expert_query_server:=' + EXPERTS)

    def kill(self, task):
        task.signal(signal.SIGKILL)
        self.assertEqual(task.wait(), -signal.SIGKILL)

    def test_a_goal_of_the_killed_program_has_ended_before_anything_is_sent(self):
        traffic = Traffic(self)
        task = self.run_task(goal=Behaviour.HANG)
        self.assertTrue(wait_for(lambda: traffic.active, 30.0), task.output())
        self.kill(task)
        again = self.run_task('--resume')
        self.assertTrue(again.says('OUTCOME succeeded', 40.0), again.output())
        self.assertEqual(again.wait(), 0, again.output())
        self.assertTrue(wait_for(lambda: len(traffic.results) == 2), traffic.results)
        first, second = traffic.results
        self.assertEqual((first.status.status, second.status.status),
                         (GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED))
        self.assertGreater(second.status.goal_id.stamp, first.header.stamp)
        self.assertNotIn('LOOKS', again.output())
        self.assertIn('SEEN 1.5 [[0, 1, 2], [3, 4, 5]]', again.output())

    def test_a_question_that_was_open_is_open_again_and_answered_once(self):
        expert = FrontEnd(self, EXPERTS)
        asks = ('--config', self.settings)
        task = self.run_task(*asks, told='aborted')
        entry = expert.question(30.0)
        self.assertIsNotNone(entry, task.output())
        self.kill(task)
        again = self.run_task('--resume', *asks)
        self.assertTrue(again.says('goes on'), again.output())
        log = EventLog(self, 'task')
        self.assertTrue(wait_for(log.connected))
        found = expert.question(30.0, 'TELL')
        self.assertEqual(found.query.query_id, entry.query.query_id)
        reply = expert.answer(AnswerQueryRequest(
            query_id=entry.query.query_id,
            decision=ExpertDecision(kind=ExpertDecision.GOTO, state='TELL', by='Ann')))
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(again.says('OUTCOME succeeded', 30.0), again.output())
        self.assertEqual(len(log.wait_for(OracleEvent.QUERY_ANSWERED)), 1)
        self.assertEqual(again.output().count('SEEN'), 1)
        later = expert.answer(AnswerQueryRequest(
            query_id=entry.query.query_id,
            decision=ExpertDecision(kind=ExpertDecision.GIVE_UP, outcome='aborted', by='Bob')))
        self.assertFalse(later.ok)

    def test_with_nothing_stored_it_begins_anew_and_says_so(self):
        task = self.run_task('--resume')
        self.assertTrue(task.says('OUTCOME succeeded', 40.0), task.output())
        self.assertIn('has no trial that was stopped: a new one begins', task.output())
        self.assertIn('LOOKS', task.output())

    def test_the_private_parameter_names_the_store(self):
        task = oracle_run(self, self.script, str(SUCCEED), 'succeeded',
                          '_checkpoint:=' + self.store)
        self.assertTrue(task.says('OUTCOME succeeded', 40.0), task.output())
        self.assertTrue(os.path.exists(self.store))

    def test_without_a_store_nothing_can_be_resumed(self):
        task = oracle_run(self, '--resume', self.script, str(SUCCEED), 'succeeded')
        self.assertEqual(task.wait(40.0), 2, task.output())
        self.assertIn('checkpoint', task.output())


if __name__ == '__main__':
    rospy.init_node('survive_killed')
    rostest.rosrun('smach_oracle', 'survive_killed', KilledTest)
