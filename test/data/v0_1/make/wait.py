#!/usr/bin/env python3
"""A machine to be stopped from outside: wait.py node|program PLAN (acting.py)."""

import rospy
from acting import Act, begin

import smach


def build():
    """Make a machine of three states. The second one waits."""
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('BEGIN', Act('BEGIN'), {'succeeded': 'WAIT'})
        smach.StateMachine.add('WAIT', Act('WAIT'), {'succeeded': 'FINISH'})
        smach.StateMachine.add('FINISH', Act('FINISH'))
    return machine


def main():
    """One trial, in a ROS node or in a program without ROS."""
    kind, plan = rospy.myargv()[1:]
    if kind == 'node':
        rospy.init_node('wait')
    machine = build()
    begin(plan, machine)
    print('OUTCOME', machine.execute(), flush=True)


if __name__ == '__main__':
    main()
