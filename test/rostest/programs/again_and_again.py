#!/usr/bin/env python
"""One machine, executed five times; the third time something happens."""

import rospy
from working import Step, Work, line, say, telling

rospy.init_node('again_and_again')
work = Work(at=3)
machine = telling('TOP', line(('FIRST', Step('FIRST')), ('WORK', work), ('LAST', Step('LAST'))))
work.stop = machine.request_preempt
machine.userdata.count = 0
# built: machine
outcomes = []
for _ in range(5):
    if rospy.is_shutdown():
        break
    outcomes.append(machine.execute())
say('OUTCOME', *(outcomes + [machine.userdata.count, machine.is_running()]))
