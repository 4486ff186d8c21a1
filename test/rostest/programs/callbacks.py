#!/usr/bin/env python
"""Functions as states: cb_interface, CBState with arguments, a Sequence, constants by lambda."""

import rospy
from working import OUTCOMES, Work, say, telling

import smach

rospy.init_node('callbacks')


@smach.cb_interface(input_keys=['x'], output_keys=['x'], outcomes=['odd', 'even'])
def halve(ud, by, least=1):
    say('HALVE', ud.x)
    ud.x = max(ud.x // by, least)
    return 'odd' if ud.x % 2 else 'even'


@smach.cb_interface(input_keys=['count'], output_keys=['count'], outcomes=OUTCOMES)
def work(ud):
    return worker.execute(ud)


worker = Work(stop=lambda: top.request_preempt())
top = smach.Sequence(OUTCOMES, 'succeeded')
counting = smach.StateMachine(['succeeded', 'aborted', 'preempted'], ['number'], ['number'])
with counting:
    smach.StateMachine.add(
        'HALVE',
        smach.CBState(halve, [2], {'least': 3}),
        {'even': 'HALVE', 'odd': 'succeeded'},
        remapping={'x': 'number'},
    )


class Working(smach.CBState):
    """A CBState that can be preempted."""

    def request_preempt(self):
        smach.CBState.request_preempt(self)
        worker.request_preempt()

    def execute(self, ud):
        outcome = smach.CBState.execute(self, ud)
        if outcome == 'preempted':
            self.service_preempt()
        return outcome


with top:
    smach.Sequence.add('COUNT', counting)
    smach.Sequence.add('WORK', Working(work), remapping={'count': 'number'})
    smach.Sequence.add('END', smach.CBState(lambda ud: 'succeeded', outcomes=['succeeded']))
top.userdata.number = 52
telling('COUNT', counting)
telling('TOP', top)
# built: top
say('OUTCOME', top.execute(), top.userdata.number)
