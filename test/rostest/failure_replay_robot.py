#!/usr/bin/env python3
"""A robot for the tests of the last seconds before a failure: its PICK fails as often as the first
argument says. Its work takes ROS time, in which its cameras and joints are heard.
"""

import sys

import rosgraph
import rospy
from waiting import wait_for

import smach
from smach_oracle import OracleContainer

WORK_S = 1.3


class Work(smach.State):
    def __init__(self, failures):
        smach.State.__init__(self, outcomes=['done', 'failed'])
        self.failures = failures

    def execute(self, _userdata):
        for topic in rospy.get_param('~failure_cameras', []):
            wait_for(lambda each=topic: is_listened_to(each), 60.0)
        rospy.sleep(WORK_S)  # the work, under whichever clock
        self.failures -= 1
        return 'failed' if self.failures >= 0 else 'done'


def is_listened_to(topic):
    """By this node."""
    listening = dict(rosgraph.Master(rospy.get_name()).getSystemState()[1])
    return rospy.get_name() in listening.get(topic, [])


def main():
    """One trial."""
    failures = int(sys.argv[1])
    rospy.init_node('robot')
    sm = smach.StateMachine(outcomes=['done', 'failed'])
    with sm:
        smach.StateMachine.add('LOOK', Work(0), transitions={'done': 'PICK'})
        smach.StateMachine.add('PICK', Work(failures))
    OracleContainer.wrap(sm, name='FETCH', settings={'expert': {'deadline_s': 300.0}})
    sm.execute()
    if not rospy.is_shutdown():
        rospy.signal_shutdown('the trial is over')


if __name__ == '__main__':
    main()
