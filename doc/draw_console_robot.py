#!/usr/bin/env python3
"""A simulated PR2 for the console's pictures: it leaves the seeing and the picking to people."""

import rospy

import smach
from smach_oracle import OracleContainer

OUTCOMES = ['succeeded', 'aborted', 'preempted']
FAILS = {'DETECT_TABLETOP': 'no object stands out of the table', 'PICK': 'no grasp is within reach'}
OUTPUTS = {'DETECT_TABLETOP': ['table', 'objects', 'sizes'], 'PICK': ['grasp']}
SECONDS = {'LOOK_AT_TABLE': 14.0, 'PLACE': 2.0}  # together more than a replay holds
INPUTS = {'PICK': ['objects', 'arm'], 'PLACE': ['grasp']}


class Work(smach.State):
    """Takes some seconds, and fails where `FAILS` says so."""

    def __init__(self, label):
        smach.State.__init__(
            self, OUTCOMES, input_keys=INPUTS.get(label, []), output_keys=OUTPUTS.get(label, [])
        )
        self._label = label

    def execute(self, ud):
        rospy.sleep(SECONDS.get(self._label, 6.0))  # the state takes so long
        if self._label in FAILS:
            raise RuntimeError(FAILS[self._label])
        return 'succeeded'


def main():
    """One trial."""
    rospy.init_node('robot')
    labels = ['LOOK_AT_TABLE', 'DETECT_TABLETOP', 'PICK', 'PLACE']
    sm = smach.StateMachine(OUTCOMES)
    sm.userdata.arm = 'right'
    with sm:
        for label, following in zip(labels, labels[1:] + ['succeeded']):
            smach.StateMachine.add(label, Work(label), {'succeeded': following})
    OracleContainer.wrap(
        sm,
        name='CLEAR_TABLE',
        settings={
            'states': {label: {'prior': 0.75} for label in FAILS},  # so that a person is asked
            'expert': {
                'deadline_s': 900.0,
                'interfaces': {
                    'perception': {
                        'action': '/perception_interface',
                        'states': ['DETECT_TABLETOP'],
                        'description': 'Mark the object in the camera frame',
                    },
                    'manipulation': {
                        'action': '/manipulation_interface',
                        'states': ['PICK'],
                        'description': 'Drive the hand',
                    },
                },
            },
            'tree': {'escalate': False},
        },
    )
    sm.execute()
    rospy.spin()


if __name__ == '__main__':
    main()
