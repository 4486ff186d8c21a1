#!/usr/bin/env python
"""Machines built in functions, three deep, with remappings; the exit code is the outcome."""

import sys

import rospy
from working import OUTCOMES, Step, Work, line, say, telling

import smach

KEYS = {'input_keys': ['number'], 'output_keys': ['number']}


def grasp(stop):
    machine = smach.StateMachine(OUTCOMES, **KEYS)
    with machine:
        smach.StateMachine.add(
            'OPEN', Step('OPEN'), {'succeeded': 'WORK'}, remapping={'count': 'number'}
        )
        smach.StateMachine.add('WORK', Work(stop=stop), remapping={'count': 'number'})
    return telling('GRASP', machine)


def pick(stop):
    machine = smach.StateMachine(OUTCOMES, input_keys=['items'], output_keys=['items'])
    with machine:
        smach.StateMachine.add(
            'GRASP', grasp(stop), {'succeeded': 'LIFT'}, remapping={'number': 'items'}
        )
        smach.StateMachine.add('LIFT', Step('LIFT'), remapping={'count': 'items'})
    return telling('PICK', machine)


def main():
    rospy.init_node('nested_functions')
    top = smach.StateMachine(OUTCOMES)
    top.userdata.count = 5
    with top:
        smach.StateMachine.add('LOOK', Step('LOOK'), {'succeeded': 'PICK'})
        smach.StateMachine.add(
            'PICK', pick(top.request_preempt), {'succeeded': 'PLACE'}, remapping={'items': 'count'}
        )
        smach.StateMachine.add(
            'PLACE',
            line(
                ('PUT', Step('PUT')),
                ('LEAVE', Step('LEAVE')),
                input_keys=['count'],
                output_keys=['count'],
            ),
        )
    telling('TOP', top)
    # built: top
    outcome = top.execute()
    say('OUTCOME', outcome, top.userdata.count)
    return OUTCOMES.index(outcome)


if __name__ == '__main__':
    sys.exit(main())
