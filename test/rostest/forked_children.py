#!/usr/bin/env python3
"""A node under oracle_run stays what it is, however its forked children end: registered, connected
and heard.
"""

import sys
import tempfile
import unittest
from typing import List

import rosgraph
import rospy
from oracle_support import EventLog, oracle_run, recorded_events, script
from std_msgs.msg import String
from waiting import wait_for

from smach_oracle.msg import OracleEvent

TASK = """
import multiprocessing, os, signal, sys, time, rospy, smach
from std_msgs.msg import String
rospy.init_node('task')
topic = rospy.Publisher('/task/said', String, queue_size=10, latch=True)
how = sys.argv[1]
def wait_for_shutdown(begun):
    begun.set()
    while not rospy.is_shutdown():
        time.sleep(0.01)
def work(begun):
    begun.set()
    time.sleep(60)
class Plan(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'preempted'])
    def execute(self, userdata):
        topic.publish('before')
        sys.stdin.readline()
        if how == 'exits':
            child = os.fork()
            if not child:
                sys.exit(3)
            print('CHILD {}'.format(os.waitpid(child, 0)[1]), flush=True)
            return 'succeeded'
        context = multiprocessing.get_context('fork')
        begun = context.Event()
        child = context.Process(target=wait_for_shutdown if how == 'terminated' else work,
                                args=(begun,))
        child.start()
        begun.wait()
        child.terminate() if how == 'terminated' else child.kill()
        child.join()
        print('CHILD {}'.format(child.exitcode), flush=True)
        return 'succeeded'
class Drive(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'preempted'])
    def execute(self, userdata):
        topic.publish('after')
        sys.stdin.readline()
        return 'preempted' if self.preempt_requested() else 'succeeded'
sm = smach.StateMachine(outcomes=['succeeded', 'preempted'])
with sm:
    smach.StateMachine.add('PLAN', Plan(), {'succeeded': 'DRIVE'})
    smach.StateMachine.add('DRIVE', Drive())
print('OUT {}'.format(sm.execute()), flush=True)
"""
# how a child ends, and the status that its parent gets
ENDS = {'exits': 'CHILD 768', 'terminated': 'CHILD 0', 'killed': 'CHILD -9'}


class ForkedChildrenTest(unittest.TestCase):
    def topics(self) -> List[str]:
        """What the node publishes, as the master knows it."""
        publishers = rosgraph.Master('/forked_children').getSystemState()[0]
        return sorted(name for name, nodes in publishers if '/task' in nodes)

    def check(self, how: str) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        heard: List[str] = []
        subscriber = rospy.Subscriber(
            '/task/said', String, lambda message: heard.append(message.data)
        )
        self.addCleanup(subscriber.unregister)
        log = EventLog(self, 'task')
        task = oracle_run(self, '--record', folder.name, script(self, TASK), how)
        self.assertTrue(wait_for(lambda: 'before' in heard and log.connected()), task.output())
        (connection,) = subscriber.impl.connections
        topics = self.topics()
        task.go_on()
        self.assertTrue(task.says(ENDS[how]), task.output())
        self.assertTrue(wait_for(lambda: 'after' in heard), task.output())
        self.assertEqual(subscriber.impl.connections, [connection], 'it is still the same')
        self.assertEqual(self.topics(), topics)
        task.go_on()
        self.assertEqual(task.wait(), 0, task.output())
        self.assertIn('OUT succeeded', task.output())
        self.assertEqual(task.output().count('registered'), 0, task.output())
        (events,) = recorded_events(folder.name)
        self.assertEqual([event.seq for event in events], list(range(len(events))))
        self.assertEqual(events[-1].kind, OracleEvent.TRIAL_END)
        self.assertEqual(
            [event.seq for event in log.events], [event.seq for event in events][-len(log.events) :]
        )

    def test_a_child_that_exits(self) -> None:
        self.check('exits')

    def test_a_child_that_rospy_shuts_down(self) -> None:
        self.check('terminated')

    def test_a_child_that_is_killed(self) -> None:
        self.check('killed')


if __name__ == '__main__':
    import rostest

    rospy.init_node('forked_children')
    rostest.rosrun('smach_oracle', 'forked_children', ForkedChildrenTest, sys.argv)
