#!/usr/bin/env python
"""A subclass that builds itself, with an `execute` of its own; another one below it."""

import rospy
from working import OUTCOMES, Step, Work, say, telling

import smach


class Robot(smach.StateMachine):
    """Made and run as `Robot().execute()`."""

    def __init__(self, arms=2):
        super().__init__(outcomes=OUTCOMES)
        self.userdata.count = 10 * arms
        self.runs = 0
        with self:
            self.add('FIRST', Step('FIRST'), {'succeeded': 'ARM'})
            self.add('ARM', Arm(self), {'succeeded': 'LAST'})
            self.add('LAST', Step('LAST'))
        telling('ROBOT', self)

    def execute(self, parent_ud=None):
        self.runs += 1
        say('ROBOT begins', self.runs)
        outcome = super().execute() if parent_ud is None else super().execute(parent_ud)
        say('ROBOT has ended', outcome)
        return outcome


class Arm(smach.StateMachine):
    """Inside the other."""

    def __init__(self, robot):
        super().__init__(OUTCOMES, input_keys=['count'], output_keys=['count'])
        with self:
            self.add('WORK', Work(stop=robot.request_preempt), {'succeeded': 'AFTER'})
            self.add('AFTER', Step('AFTER'))
        telling('ARM', self)


if __name__ == '__main__':
    rospy.init_node('self_building')
    robot = Robot()
    # built: robot
    say('OUTCOME', robot.execute(), robot.userdata.count)
