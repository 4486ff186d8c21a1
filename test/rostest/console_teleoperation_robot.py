#!/usr/bin/env python3
"""A robot whose PICK never succeeds by itself; a person may drive its hand, through an interface
started on demand.
"""

import rospy

import smach
from smach_oracle import OracleContainer

OUTCOMES = ['succeeded', 'aborted', 'preempted']


class Pick(smach.State):
    """Always fails."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES, output_keys=['grasp'])

    def execute(self, ud):
        return 'aborted'


class Place(smach.State):
    """Tells that it was reached."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES, input_keys=['grasp'])

    def execute(self, ud):
        rospy.set_param('~placed', ud.grasp.header.frame_id)
        return 'succeeded'


def main():
    """One trial."""
    rospy.init_node('robot')
    sm = smach.StateMachine(OUTCOMES)
    with sm:
        smach.StateMachine.add('PICK', Pick(), {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', Place())
    OracleContainer.wrap(
        sm,
        name='FETCH',
        settings={
            'prior': 0.8,
            'expert': {
                'deadline_s': 300.0,
                'interfaces': {
                    'manipulation': {
                        'action': '/manipulation_interface',
                        'description': 'Drive the hand',
                        'states': ['PICK'],
                        'node': 'smach_oracle manipulation_interface',
                        'args': ['__name:=manipulation_interface'],
                    }
                },
            },
        },
    )
    sm.execute()
    rospy.spin()


if __name__ == '__main__':
    main()
