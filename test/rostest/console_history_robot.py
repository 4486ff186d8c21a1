#!/usr/bin/env python3
"""A robot for the tests of the console's situation and history: its PICK fails until its work is
done by somebody else.

Of PICK's preconditions one function looks at a parameter, one raises, one hangs, and one is a
state.
"""

import threading

import rosgraph
import rospy
from console_robot import Work, chain
from sensor_msgs.msg import Image
from waiting import wait_for

import smach
from smach_oracle import OracleContainer

CALLED = {'hangs': 0}


def hand_is_free(_userdata):
    return rospy.get_param('~hand_is_free', False)


def camera_answers(_userdata):
    raise RuntimeError('no <b>camera</b>')


def door_is_shut(_userdata):
    CALLED['hangs'] += 1
    rospy.set_param('~looked_at_the_door', CALLED['hangs'])
    threading.Event().wait()


class Detect(Work):
    """Needs the cameras: what they see when PICK fails has then been heard."""

    def execute(self, ud):
        for topic in rospy.get_param('~failure_cameras', []):
            wait_for(lambda each=topic: self.is_listened_to(each), 60.0)
            rospy.wait_for_message(topic, Image, 60.0)
        return super().execute(ud)

    @staticmethod
    def is_listened_to(topic):
        """By the oracle of this node."""
        listening = dict(rosgraph.Master(rospy.get_name()).getSystemState()[1])
        return rospy.get_name() in listening.get(topic, [])


def main():
    """One trial after the other."""
    rospy.init_node('robot')

    def make(label):
        if label == 'DETECT':
            return Detect(label, [], 0.1)
        return Work(label, ['PICK'], 0.1, ['grasp', 'fits', 'tries'] if label == 'PICK' else [])

    sm = chain(['DETECT', 'PICK', 'PLACE'], make)
    sm.userdata.grasp, sm.userdata.fits, sm.userdata.tries = [1, 2], False, 3
    OracleContainer.wrap(
        sm,
        name='FETCH',
        settings={'prior': 0.8, 'high_from': 0.75, 'expert': {'deadline_s': 300.0}},
        preconditions={
            'PICK': [hand_is_free, camera_answers, 'DETECT'],
            'PLACE': [(door_is_shut, smach.CBState(lambda ud: 'done', ['done']))],
        },
    )
    while not rospy.is_shutdown():
        sm.execute()


if __name__ == '__main__':
    main()
