#!/usr/bin/env python3
"""A shared-autonomy interface that does the work of any state at once."""

import actionlib
import rospy

from smach_oracle.msg import SharedAutonomyAction, SharedAutonomyResult, UserdataItem


def main():
    """Until the node is stopped."""
    rospy.init_node('by_hand')

    def work(goal):
        print('Now the work of {} is done by hand'.format(goal.state), flush=True)
        outputs = [
            UserdataItem(key=key, encoding=UserdataItem.JSON, value=b'"by hand"')
            for key in goal.output_keys
        ]
        server.set_succeeded(SharedAutonomyResult('succeeded', outputs, 'done'))

    server = actionlib.SimpleActionServer('by_hand', SharedAutonomyAction, work, auto_start=False)
    server.start()
    rospy.spin()


if __name__ == '__main__':
    main()
