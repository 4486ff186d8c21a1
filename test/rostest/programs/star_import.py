#!/usr/bin/env python
# ruff: noqa: F403, F405
# a machine at the top of a script, as beginners write it
import sys

import rospy

from smach import *
from smach_ros import *

rospy.init_node('star_import')
how = sys.argv[1]


class Foo(State):
    def __init__(self):
        State.__init__(self, outcomes=['outcome1', 'outcome2'], output_keys=['counter'])
        self.counter = 0

    def execute(self, userdata):
        print('FOO', self.counter)
        if self.counter < 3:
            self.counter += 1
            userdata.counter = self.counter
            return 'outcome1'
        return 'outcome2'


class Bar(State):
    def __init__(self):
        State.__init__(self, outcomes=['outcome1', 'failed', 'preempted'], input_keys=['counter'])
        self.spoilt = False

    def execute(self, userdata):
        print('BAR', userdata.counter)
        if userdata.counter == 2 and (not self.spoilt or how.startswith('always')):
            self.spoilt = True
            if how.endswith('fails'):
                print('BAR does not succeed')
                return 'failed'
            if how.endswith('raises'):
                print('BAR does not succeed')
                raise ValueError('no such thing')
            if how == 'preempted':
                sm.request_preempt()
        if self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        return 'outcome1'


sm = StateMachine(outcomes=['outcome4', 'failed', 'preempted'])
with sm:
    StateMachine.add('FOO', Foo(), transitions={'outcome1': 'BAR', 'outcome2': 'outcome4'})
    StateMachine.add('BAR', Bar(), transitions={'outcome1': 'FOO'})
# built: sm
outcome = sm.execute()
print('OUTCOME', outcome)
sys.exit({'outcome4': 0, 'failed': 3, 'preempted': 4}[outcome])
