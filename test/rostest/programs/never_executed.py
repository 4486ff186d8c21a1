#!/usr/bin/env python
"""Builds a machine and looks at it; nobody executes it, and its states are used by hand."""

import sys

import rospy
from working import Step, Work, ending, line, say

import smach

rospy.init_node('never_executed')
machine = line(('FIRST', Step('FIRST')), ('WORK', Work()), ('LAST', Step('LAST')))
machine.check_consistency()
say('STATES', *machine.get_children())
say('EDGES', *sorted(machine.get_internal_edges()))
if ending() == 'preempted':
    machine.request_preempt()
    sys.exit(4 * machine.preempt_requested())
userdata = smach.UserData()
userdata.count = 3
say('OUTCOME', machine['WORK'].execute(userdata), userdata.count)
