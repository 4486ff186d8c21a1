#!/usr/bin/env python3
"""A script whose only goal hangs, for a test that presses Ctrl-C."""

import rospy
from actionlib.msg import TestAction, TestGoal
from smach_ros_action_node import Behaviour

import smach
from smach_ros import SimpleActionState

if __name__ == '__main__':
    rospy.init_node('hanging_script')
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add(
            'HANG', SimpleActionState('work', TestAction, goal=TestGoal(Behaviour.HANG))
        )
    print('ended: %s' % machine.execute())
