#!/usr/bin/env python
"""Executed within the callback of a timer, once."""

import threading

import rospy
from working import Step, Work, line, say, telling

import smach

rospy.init_node('in_a_timer')
done = threading.Event()
work = Work()
machine = telling('TOP', line(('FIRST', Step('FIRST')), ('WORK', work), ('LAST', Step('LAST'))))
work.stop = machine.request_preempt
machine.userdata.count = 0
# built: machine


def tick(event):
    try:
        say('OUTCOME', machine.execute(), event.last_real)
    except smach.InvalidUserCodeError as err:
        say('OUTCOME', type(err).__name__)
    finally:
        done.set()


rospy.Timer(rospy.Duration(0.05), tick, oneshot=True)
while not done.is_set() and not rospy.is_shutdown():
    rospy.sleep(0.05)  # as scripts poll, beside their timers
