#!/usr/bin/env python3
"""After SIGINT or SIGTERM the arm is stowed behind `preempted`, by topics and actions that work."""

import json
import signal
import sys
import tempfile
import time
import unittest
from typing import Any, Dict, List, Optional

import actionlib
import rospy
from actionlib.msg import TestAction, TestGoal, TestResult
from oracle_support import SIGNALS, Process, oracle_run, recorded_events, script
from std_msgs.msg import String
from waiting import END_LIMIT_S, wait_for

from smach_oracle.msg import OracleEvent

# the limit of what the states behind a preempt may take, far more than they need
LIMIT_S = 8.0
TASK = """
import sys, time, actionlib, rospy, smach, smach_ros
from actionlib.msg import TestAction, TestGoal
from std_msgs.msg import String
rospy.init_node('task')
how = sys.argv[1]
def note(text):
    print(text, flush=True)
class Work(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'preempted'])
    def execute(self, userdata):
        note('THERE')
        while not self.preempt_requested():
            time.sleep(0.01)
        note('PREEMPTED')
        self.service_preempt()
        return 'preempted'
class Stow(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['stowed', 'preempted'])
    def execute(self, userdata):
        note('STOWING')
        while how == 'for_ever' and not self.preempt_requested():
            time.sleep(0.01)
        topic = rospy.Publisher('/arm', String, queue_size=1)
        while not topic.get_num_connections() and not rospy.is_shutdown():
            rospy.sleep(0.01)
        topic.publish('stowing')
        client = actionlib.SimpleActionClient('/stow', TestAction)
        client.wait_for_server()
        client.send_goal(TestGoal(goal=7))
        client.wait_for_result()
        note('RESULT %s %s' % (client.get_result().result, rospy.is_shutdown()))
        return 'stowed'
sm = smach.StateMachine(outcomes=['succeeded', 'preempted', 'stowed'])
with sm:
    smach.StateMachine.add('WORK', Work(), {'preempted': 'STOW'})
    smach.StateMachine.add('STOW', Stow())
def run():
    while not rospy.is_shutdown():
        note('OUTCOME %s' % sm.execute())
if how == 'in_a_thread':
    import threading
    runner = threading.Thread(target=run)
    runner.start()
    rospy.spin()
    runner.join()
else:
    run()
"""


class AfterPreemptTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.bags = folder.name
        self.heard: List[str] = []
        subscriber = rospy.Subscriber(
            '/arm', String, lambda message: self.heard.append(message.data)
        )
        self.addCleanup(subscriber.unregister)
        self.goals: List[int] = []
        self.server = actionlib.SimpleActionServer('/stow', TestAction, self.stow, auto_start=False)
        self.server.start()
        self.addCleanup(self.server.action_server.stop)

    def stow(self, goal: TestGoal) -> None:
        time.sleep(0.5)  # an arm takes a while: rospy would be gone by then
        self.goals.append(goal.goal)
        self.server.set_succeeded(TestResult(result=goal.goal))

    def start(self, how: str, after_preempt_s: Optional[float] = LIMIT_S) -> Process:
        given: Dict[str, Any] = {'expert': {'deadline_s': 1.0}}
        if after_preempt_s is not None:
            given['after_preempt_s'] = after_preempt_s
        task = oracle_run(
            self,
            '--config',
            script(self, json.dumps(given), 'oracle.yaml'),
            '--record',
            self.bags,
            script(self, TASK),
            how,
        )
        self.assertTrue(task.says('THERE'), task.output())
        return task

    def check_stowed(self, how: str, number: int) -> None:
        task = self.start(how)
        task.signal(number)
        code = task.wait()
        self.assertEqual((code, self.heard, self.goals), (0, ['stowing'], [7]), task.output())
        self.assertIn('RESULT 7 False', task.output())
        self.assertEqual(task.output().count('THERE'), 1, 'no other trial has begun')
        self.assertIn('OUTCOME stowed', task.output())
        (events,) = recorded_events(self.bags)
        self.assertEqual((events[-1].kind, events[-1].outcome), (OracleEvent.TRIAL_END, 'stowed'))

    def test_a_machine_in_the_main_thread_stows_after_sigint(self) -> None:
        self.check_stowed('', signal.SIGINT)

    def test_a_machine_in_the_main_thread_stows_after_sigterm(self) -> None:
        self.check_stowed('', signal.SIGTERM)

    def test_a_machine_in_a_thread_stows_after_sigint(self) -> None:
        self.check_stowed('in_a_thread', signal.SIGINT)

    def test_a_machine_in_a_thread_stows_after_sigterm(self) -> None:
        self.check_stowed('in_a_thread', signal.SIGTERM)

    def test_by_default_nothing_moves_any_more(self) -> None:
        for number in SIGNALS:
            task = self.start('', None)
            task.signal(number)
            task.wait()
            self.assertEqual((self.heard, self.goals), ([], []), task.output())
            self.assertNotIn('STOWING', task.output())

    def test_the_limit_ends_what_does_not_end(self) -> None:
        task = self.start('for_ever', 1.5)
        sent = time.monotonic()
        task.signal(signal.SIGINT)
        self.assertTrue(task.says('STOWING'), task.output())
        task.wait()
        took_s = time.monotonic() - sent
        self.assertGreater(took_s, 1.5)
        self.assertLess(took_s, 1.5 + END_LIMIT_S)
        self.assertEqual(len(recorded_events(self.bags)), 1)

    def test_a_second_signal_ends_it_at_once(self) -> None:
        task = self.start('for_ever', 60.0)
        task.signal(signal.SIGINT)
        self.assertTrue(task.says('STOWING'), task.output())
        sent = time.monotonic()
        task.signal(signal.SIGINT)
        task.wait()
        self.assertLess(time.monotonic() - sent, END_LIMIT_S)

    def test_the_preempt_is_not_delayed(self) -> None:
        task = self.start('for_ever', 60.0)
        task.signal(signal.SIGTERM)
        self.assertTrue(wait_for(lambda: 'PREEMPTED' in task.output(), END_LIMIT_S))


if __name__ == '__main__':
    import rostest

    rospy.init_node('after_preempt')
    rostest.rosrun('smach_oracle', 'after_preempt', AfterPreemptTest, sys.argv)
