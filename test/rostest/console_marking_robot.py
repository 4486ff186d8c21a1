#!/usr/bin/env python3
"""A robot that never sees anything by itself: its PICK tells, as a parameter, where it was told
that the object is.
"""

import rospy

import smach
from smach_oracle import OracleContainer

OUTCOMES = ['succeeded', 'aborted', 'preempted']


class Detect(smach.State):
    """Always fails."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES, output_keys=['table', 'objects', 'sizes'])

    def execute(self, ud):
        return 'aborted'


class Pick(smach.State):
    """Takes the first object."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES, input_keys=['objects'])

    def execute(self, ud):
        place = ud.objects[0].pose.position
        rospy.set_param('~picked', [place.x, place.y, place.z])
        return 'succeeded'


def main():
    """One trial after the other."""
    rospy.init_node('robot')
    sm = smach.StateMachine(OUTCOMES)
    with sm:
        smach.StateMachine.add('DETECT_TABLETOP', Detect(), {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', Pick())
    OracleContainer.wrap(
        sm,
        name='FETCH',
        settings={
            'prior': 0.8,
            'high_from': 0.75,
            'expert': {
                'deadline_s': 300.0,
                'interfaces': {
                    'perception': {
                        'action': '/perception_interface',
                        'states': ['DETECT_TABLETOP'],
                        'description': 'Mark the object in the camera frame',
                    }
                },
            },
            'tree': {'escalate': False},
        },
    )
    while not rospy.is_shutdown():
        sm.execute()


if __name__ == '__main__':
    main()
