#!/usr/bin/env python3
"""Fetch something: a flat machine. Each argument is the plan of one trial (acting.py)."""

import rospy
from acting import Act, begin, take
from geometry_msgs.msg import PoseStamped

import smach


def hand_is_empty(userdata):
    """A precondition: met unless the plan has it otherwise."""
    return take('hand') != 'full'


def build():
    """The machine, as any SMACH user writes it."""
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    states = {
        'LOOK': Act('LOOK', outputs={'pose': PoseStamped()}),
        'PICK': Act('PICK', ['dropped'], ['pose'], {'grasp': 'from above'}),
        'CARRY': Act('CARRY', input_keys=['grasp']),
        'PLACE': Act('PLACE', outputs={'place': [0.4, -0.2, 0.75]}),
        'REPORT': Act('REPORT', input_keys=['place'], outputs={'report': 'written'}),
    }
    with machine:
        smach.StateMachine.add('LOOK', states['LOOK'], {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', states['PICK'], {'succeeded': 'CARRY', 'dropped': 'LOOK'})
        smach.StateMachine.add('CARRY', states['CARRY'], {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', states['PLACE'], {'succeeded': 'REPORT'})
        smach.StateMachine.add('REPORT', states['REPORT'])
    return machine


def main():
    """One trial for each argument."""
    rospy.init_node('fetch')
    machine = build()
    for word in rospy.myargv()[1:]:
        begin(word, machine)
        try:
            print('OUTCOME', machine.execute(), flush=True)
        except (smach.InvalidUserCodeError, smach.InvalidTransitionError):
            print('ERROR', flush=True)


if __name__ == '__main__':
    main()
