#!/usr/bin/env python3
"""An expert for REPORT: claims a question, gives it back, claims it again, chooses an interface."""

import rospy

from smach_oracle.expert.front_end import FrontEnd, wait_for_question
from smach_oracle.msg import ExpertDecision

DECISION = ExpertDecision(kind=ExpertDecision.INTERFACE, interface='by_hand', why='quicker so')


def main():
    """Until the node is stopped."""
    rospy.init_node('hesitant')
    front_end = FrontEnd('hesitant')
    while not rospy.is_shutdown():
        listed = wait_for_question(front_end, timeout_s=1.0)
        if listed is None or listed.goal.failed_state != 'REPORT':
            rospy.rostime.wallsleep(0.1)
            continue
        front_end.claim(listed)
        rospy.rostime.wallsleep(0.3)
        front_end.release(listed)
        rospy.rostime.wallsleep(0.3)
        front_end.claim(listed)
        front_end.answer(listed, DECISION)
        front_end.release(listed)


if __name__ == '__main__':
    main()
