"""What the rostests of killed programs share: a task, and what its action server says."""

import os
import signal
import tempfile
import unittest

import rosgraph
import rospy
from actionlib.msg import TestActionResult
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from oracle_support import oracle_run, script
from smach_ros_action_node import Behaviour
from smach_ros_support import ActionNodeProcess
from waiting import wait_for

from smach_oracle.ros.expert.server import ExpertQueryServer

SCRIPT = """
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
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
SUCCEED = 150  # number of a goal
EXPERTS = '/experts'
ASKS = 'max_recoveries: 0\npolicy: prose\n'


class Traffic:
    """What the action server, which is never killed, says of its goals."""

    def __init__(self, test):
        self.results = []
        self.active = set()  # ids of all that ever were
        self.statuses = 0  # messages
        self._listen(test, 'status', GoalStatusArray, self._status)
        # A server opens all its topics before it sends its first status. While one registers a
        # publisher, rospy may lose it for whoever subscribes
        test.assertTrue(wait_for(lambda: self.statuses), 'the server sends no status')
        results = self._listen(test, 'result', TestActionResult, self.results.append)
        test.assertTrue(wait_for(results.get_num_connections), 'the server sends no results')

    @staticmethod
    def _listen(test, end, kind, note):
        subscriber = rospy.Subscriber('/arm/' + end, kind, note, queue_size=10)
        test.addCleanup(subscriber.unregister)
        return subscriber

    def _status(self, message):
        self.statuses += 1
        self.active.update(
            each.goal_id.id for each in message.status_list if each.status == GoalStatus.ACTIVE
        )


class SurvivingCase(unittest.TestCase):
    """Runs the task with a store, and kills it."""

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
        return oracle_run(
            self,
            '--checkpoint',
            self.store,
            *words,
            self.script,
            str(goal),
            told,
            '_expert_query_server:=' + EXPERTS,
        )

    def run_until_it_moves(self, *words, goal=Behaviour.HANG):
        """Return the task once its goal is under way, and what the server says."""
        traffic = Traffic(self)
        task = self.run_task(*words, goal=goal)
        # two limits: a program that starts slowly has lost no goal
        if not (task.says('LOOKS', 60.0) and wait_for(lambda: traffic.active, 40.0)):
            self.fail('\n'.join(self._where_it_hangs(task, traffic)))
        return task, traffic

    def _where_it_hangs(self, task, traffic):
        """Say of both ends of the action what they do. Both processes end."""
        yield '{} messages of status; the server {}; this node {}'.format(
            traffic.statuses,
            'runs' if self.server.process.poll() is None else 'is gone',
            'is shut down' if rospy.is_shutdown() else 'runs',
        )
        for kind, topics in zip(
            ('publishers', 'subscribers'), rosgraph.Master(rospy.get_name()).getSystemState()
        ):
            yield '{}: {}'.format(kind, [each for each in topics if each[0].startswith('/arm/')])
        self.server.process.send_signal(signal.SIGABRT)  # its threads go to the log of the test
        yield task.threads()

    def kill(self, task):
        task.signal(signal.SIGKILL)
        self.assertEqual(task.wait(), -signal.SIGKILL)
