#!/usr/bin/env python
"""SMACH without a node; a machine that a state executes inside its own `execute`."""

from working import OUTCOMES, Step, Work, line, say, telling

import smach


class Fetch(smach.State):
    """Has a machine of its own, which nobody around it sees."""

    def __init__(self):
        smach.State.__init__(self, OUTCOMES, input_keys=['first'], output_keys=['count'])
        self.machine = line(
            ('REACH', Step('REACH')), ('WORK', Work(stop=stop)), ('LIFT', Step('LIFT'))
        )
        telling('INNER', self.machine)
        # built: self.machine

    def request_preempt(self):
        smach.State.request_preempt(self)
        self.machine.request_preempt()

    def execute(self, ud):
        self.machine.userdata.count = ud.first
        outcome = self.machine.execute()
        if outcome == 'preempted':
            self.service_preempt()
        ud.count = self.machine.userdata.count
        return outcome


def stop():
    top.request_preempt()


top = smach.StateMachine(OUTCOMES)
top.userdata.first = 40
with top:
    smach.StateMachine.add('FETCH', Fetch(), {'succeeded': 'LAST'})
    smach.StateMachine.add('LAST', Step('LAST'))
telling('TOP', top)
# built: top
say('OUTCOME', top.execute(), top.userdata.count)
