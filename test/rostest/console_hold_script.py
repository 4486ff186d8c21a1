#!/usr/bin/env python3
"""A plain SMACH script, trial after trial: each state runs until it is let go, or preempted."""

import rospy

import smach


class Work(smach.State):
    """Ends as soon as the parameter ~done holds its label."""

    def __init__(self, label):
        smach.State.__init__(self, outcomes=['succeeded', 'preempted'])
        self._label = label

    def execute(self, ud):
        while not rospy.is_shutdown():
            if self.preempt_requested():
                self.service_preempt()
                return 'preempted'
            if self._label in rospy.get_param('~done', []):
                return 'succeeded'
            rospy.sleep(0.02)  # as a state of a script looks for its end
        return 'preempted'


def main():
    rospy.init_node('alpha')
    inner = smach.StateMachine(['succeeded', 'preempted'])
    with inner:
        smach.StateMachine.add('THIRD', Work('THIRD'), {'succeeded': 'FOURTH'})
        smach.StateMachine.add('FOURTH', Work('FOURTH'))
    sm = smach.StateMachine(['succeeded', 'preempted'])
    with sm:
        smach.StateMachine.add('FIRST', Work('FIRST'), {'succeeded': 'SECOND'})
        smach.StateMachine.add('SECOND', Work('SECOND'), {'succeeded': 'INNER'})
        smach.StateMachine.add('INNER', inner)
    while not rospy.is_shutdown():
        rospy.set_param('~outcomes', rospy.get_param('~outcomes', []) + [sm.execute()])


if __name__ == '__main__':
    main()
