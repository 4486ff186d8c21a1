#!/usr/bin/env python
"""Hooks at the shutdown, a shutdown check of its own, a log of its own, an exit handler.

What ends it is `rospy.signal_shutdown` in another thread, while `rospy.spin` waits.
"""

import atexit
import threading

import rospy
from working import Step, Work, line, say, telling

import smach

rospy.init_node('shutdown_hooks')
results = []
atexit.register(lambda: say('EXIT', *results))
rospy.on_shutdown(lambda: say('HOOK', machine.is_running()))
smach.set_shutdown_check(rospy.is_shutdown)
smach.set_loggers(*[lambda text, *args: None] * 4)
work = Work()
machine = telling('TOP', line(('FIRST', Step('FIRST')), ('WORK', work), ('LAST', Step('LAST'))))
work.stop = machine.request_preempt
machine.userdata.count = 0
# built: machine


def run():
    try:
        results.append(machine.execute())
    finally:
        rospy.signal_shutdown('the machine has ended')


worker = threading.Thread(target=run)
worker.start()
rospy.spin()
worker.join()
say('OUTCOME', *results)
