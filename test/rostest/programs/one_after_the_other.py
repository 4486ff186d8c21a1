#!/usr/bin/env python
"""Several machines in turn: the first of other states, then a new one of the same for each item."""

import rospy
from working import Step, Work, line, say, telling

rospy.init_node('one_after_the_other')
start = telling('START', line(('HOME', Step('HOME')), ('CALIBRATE', Step('CALIBRATE'))))
start.userdata.count = 0
# built: start
outcomes = [start.execute()]
for number, item in enumerate(['cup', 'can', 'box']):
    work = Work(how=None if item == 'can' else 'well')
    machine = telling(item, line(('LOOK', Step('LOOK')), ('WORK', work), ('PUT', Step('PUT'))))
    work.stop = machine.request_preempt
    machine.userdata.count = 100 * number
    # built: machine
    outcomes.append(machine.execute())
say('OUTCOME', *outcomes)
