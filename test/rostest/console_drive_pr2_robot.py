#!/usr/bin/env python3
"""A PR2 that never picks anything up by itself: its PLACE tells, as a parameter, what it was
given.
"""

import rospy

import smach
from smach_oracle import OracleContainer

OUTCOMES = ['succeeded', 'aborted', 'preempted']


class Pick(smach.State):
    """Always fails."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES, input_keys=['arm'], output_keys=['grasp'])

    def execute(self, ud):
        return 'aborted'


class Place(smach.State):
    """Tells where the grasp was."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES, input_keys=['grasp'])

    def execute(self, ud):
        at = ud.grasp.pose.position
        rospy.set_param('~placed', {'frame': ud.grasp.header.frame_id, 'at': [at.x, at.y, at.z]})
        return 'succeeded'


def main():
    """One trial."""
    rospy.init_node('robot')
    sm = smach.StateMachine(OUTCOMES)
    sm.userdata.arm = 'left'
    with sm:
        smach.StateMachine.add('PICK', Pick(), {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', Place())
    OracleContainer.wrap(
        sm,
        name='FETCH',
        settings={
            'prior': 0.8,
            'expert': {
                'deadline_s': 600.0,
                'interfaces': {
                    'manipulation': {
                        'action': '/manipulation_interface',
                        'description': 'Drive the hand',
                        'states': ['PICK'],
                    }
                },
            },
        },
    )
    sm.execute()
    rospy.spin()


if __name__ == '__main__':
    main()
