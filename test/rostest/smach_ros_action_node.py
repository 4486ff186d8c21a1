#!/usr/bin/env python3
"""An action server whose goals say how it should behave; it serves actionlib/TestAction for the
smach_ros tests.

Run as ``smach_ros_action_node.py ACTION_NAME``. The number of the goal chooses the behaviour (see
``Behaviour``); a goal of 100 or more succeeds at once, with a result one greater.
"""

import os
import signal
import sys
import threading

import actionlib
import rospy
from actionlib.msg import TestAction, TestFeedback, TestResult


class Behaviour:
    """Numbers a goal may carry."""

    ABORT = 1
    HANG = 2  # runs until cancelled, then reports PREEMPTED
    IGNORE_CANCEL = 3  # runs forever, whatever the client says
    SUCCEED_ON_CANCEL = 4  # runs until cancelled, then reports SUCCEEDED
    FEEDBACK = 5  # three pieces of feedback, then SUCCEEDED
    REJECT = 6
    DIE = 7  # accepts, then the process kills itself with SIGKILL
    FREEZE = 8  # accepts, then the process stops itself with SIGSTOP
    CLOSE = 9  # accepts, then withdraws its action topics while the process lives
    UNSEEN = 10  # never acknowledged in any way


class ActionNode(object):
    """The node: one actionlib.ActionServer, goals side by side."""

    def __init__(self, name):
        self.running = {}
        self.lock = threading.Lock()
        self.server = actionlib.ActionServer(
            name, TestAction, self.on_goal, self.on_cancel, auto_start=False
        )
        self.accept_goal = self.server.internal_goal_callback
        self.server.internal_goal_callback = self.on_raw_goal
        self.server.start()

    def on_raw_goal(self, message):
        if message.goal.goal != Behaviour.UNSEEN:
            self.accept_goal(message)

    def on_goal(self, handle):
        number = handle.get_goal().goal
        if number == Behaviour.REJECT:
            handle.set_rejected(text='not today')
            return
        handle.set_accepted()
        if number >= 100:
            handle.set_succeeded(TestResult(result=number + 1))
        elif number == Behaviour.ABORT:
            handle.set_aborted(TestResult(result=-1), 'told to')
        elif number == Behaviour.FEEDBACK:
            for i in range(3):
                handle.publish_feedback(TestFeedback(feedback=i))
                rospy.sleep(0.02)  # a server cannot know when its feedback has arrived
            handle.set_succeeded(TestResult(result=3))
        elif number in (Behaviour.DIE, Behaviour.FREEZE):
            rospy.sleep(0.3)  # nor when the client has seen that the goal is accepted
            os.kill(os.getpid(), signal.SIGKILL if number == Behaviour.DIE else signal.SIGSTOP)
        elif number == Behaviour.CLOSE:
            for topic in (self.server.status_pub, self.server.result_pub, self.server.feedback_pub):
                topic.unregister()
        else:
            with self.lock:
                self.running[handle.get_goal_id().id] = number

    def on_cancel(self, handle):
        with self.lock:
            number = self.running.get(handle.get_goal_id().id)
        if number == Behaviour.HANG:
            handle.set_canceled(TestResult(result=7))
        elif number == Behaviour.SUCCEED_ON_CANCEL:
            handle.set_succeeded(TestResult(result=8))


if __name__ == '__main__':
    rospy.init_node('action_node', anonymous=True)
    ActionNode(sys.argv[1])
    rospy.spin()
