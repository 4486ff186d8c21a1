#!/usr/bin/env python
"""A Concurrence at the top; the machine in it does the work."""

import rospy
from working import OUTCOMES, Step, Work, line, say, telling

import smach

rospy.init_node('top_concurrence')
both = smach.Concurrence(
    OUTCOMES,
    'aborted',
    input_keys=['count'],
    output_keys=['count'],
    outcome_map={
        'succeeded': {'ARM': 'succeeded', 'HEAD': 'succeeded'},
        'preempted': {'ARM': 'preempted'},
    },
)
arm = line(
    ('REACH', Step('REACH')),
    ('WORK', Work(stop=both.request_preempt)),
    ('LIFT', Step('LIFT')),
    input_keys=['count'],
)
telling('ARM', arm)
with both:
    smach.Concurrence.add('ARM', arm)
    smach.Concurrence.add('HEAD', smach.CBState(lambda ud: 'succeeded', outcomes=['succeeded']))
both.userdata.count = 0
# built: arm
say('OUTCOME', both.execute())
