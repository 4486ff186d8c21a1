#!/usr/bin/env python
"""An Iterator at the top, over a machine; the second item is the one."""

import rospy
from working import Step, Work, line, say, telling

import smach

rospy.init_node('top_iterator')
each = smach.Iterator(
    ['succeeded', 'aborted', 'preempted'],
    ['count'],
    ['count'],
    it=['cup', 'can', 'box'],
    it_label='item',
    exhausted_outcome='succeeded',
)
fetch = line(
    ('LOOK', Step('LOOK')),
    ('WORK', Work(stop=each.request_preempt, at=2)),
    ('PUT', Step('PUT')),
    input_keys=['item', 'count'],
    output_keys=['count'],
)
telling('FETCH', fetch)
with each:
    smach.Iterator.set_contained_state('FETCH', fetch, loop_outcomes=['succeeded'])
each.userdata.count = 0
# built: fetch
say('OUTCOME', each.execute(), each.userdata.count)
