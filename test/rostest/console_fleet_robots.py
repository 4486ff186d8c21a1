#!/usr/bin/env python3
"""Many robots, each a process of its own: their WORK fails, each goes where it is sent, and tells
where that was.
"""

import os
import signal
import sys

import rospy

import smach
from smach_oracle import OracleContainer

OUTCOMES = ['succeeded', 'aborted']


class Work(smach.State):
    """Always fails."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES)

    def execute(self, ud):
        raise RuntimeError('{} is stuck'.format(rospy.get_name()))


class Plan(smach.State):
    """Tells that it was chosen."""

    def __init__(self, number):
        smach.State.__init__(self, OUTCOMES)
        self._number = number

    def execute(self, ud):
        rospy.set_param('~went', rospy.get_param('~went', []) + [self._number])
        return 'succeeded'


def run(number, robots, lacks):
    """One robot, until it is told to end. `lacks`: the number of a plan that it does not have."""
    rospy.init_node('robot_{}'.format(number), disable_signals=False)
    sm = smach.StateMachine(OUTCOMES)
    with sm:
        smach.StateMachine.add('WORK', Work())
        for each in set(range(robots)) - {lacks}:
            smach.StateMachine.add('PLAN_{}'.format(each), Plan(each))
    OracleContainer.wrap(
        sm, name='JOB', settings={'prior': 0.8, 'high_from': 0.75, 'expert': {'deadline_s': 300.0}}
    )
    sm.execute()
    rospy.set_param('~ended', True)
    rospy.spin()


def main(robots, odd=-1):
    """Fork, so that what is imported is imported once; ends with all of them. `odd`: the number of
    a robot that has no PLAN_0.
    """
    children = []
    for number in range(robots):
        child = os.fork()
        if not child:
            run(number, robots, 0 if number == odd else -1)
            os._exit(0)
        children.append(child)

    def end(*_):
        for child in children:
            os.kill(child, signal.SIGTERM)

    signal.signal(signal.SIGTERM, end)
    for child in children:
        os.waitpid(child, 0)


if __name__ == '__main__':
    main(*map(int, sys.argv[1:]))
