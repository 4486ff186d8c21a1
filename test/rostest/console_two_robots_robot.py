#!/usr/bin/env python3
"""A robot that neither sees nor grasps anything by itself. It tells, as a parameter, where it was
told that the object is. Its interfaces lie in its own namespace.
"""

import rospy
from console_marking_robot import OUTCOMES, Detect, Pick

import smach
from smach_oracle import OracleContainer


class Grasp(Pick):
    """Tells where the object is, and never grasps it."""

    def __init__(self):
        super().__init__()
        self.register_output_keys(['grasp'])

    def execute(self, ud):
        super().execute(ud)
        return 'aborted'


def main():
    """One trial."""
    rospy.init_node('robot')
    sm = smach.StateMachine(OUTCOMES)
    with sm:
        smach.StateMachine.add('DETECT_TABLETOP', Detect(), {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', Grasp())
    OracleContainer.wrap(
        sm,
        name='FETCH',
        settings={
            'policy': 'always_ask',
            'expert': {
                'interfaces': {
                    'perception': {
                        'action': 'perception_interface',
                        'states': ['DETECT_TABLETOP'],
                    },
                    'manipulation': {
                        'action': 'manipulation_interface',
                        'states': ['PICK'],
                        'node': 'smach_oracle manipulation_interface',
                        'args': ['__name:=manipulation_interface'],
                    },
                },
            },
        },
    )
    sm.execute()
    rospy.spin()


if __name__ == '__main__':
    main()
