#!/usr/bin/env python3
"""A small SMACH script, as any SMACH user writes it: a cup is found, picked up and put down."""

import sys

import smach


class Detect(smach.State):
    """Stands for a camera that finds the cup."""

    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'], output_keys=['cup'])

    def execute(self, userdata):
        userdata.cup = (0.6, 0.1, 0.8)
        return 'succeeded'


class MoveTo(smach.State):
    """Stands for an arm that moves to where the cup is."""

    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'], input_keys=['cup'])

    def execute(self, userdata):
        return 'succeeded' if len(userdata.cup) == 3 else 'aborted'


def build_machine():
    """Return the machine, which has not run yet."""
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('DETECT', Detect(), {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', MoveTo(), {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', MoveTo())
    return machine


def main():
    """Run the machine in a node."""
    import rospy

    rospy.init_node('fetch')
    sys.exit(0 if build_machine().execute() == 'succeeded' else 1)


if __name__ == '__main__':
    main()
