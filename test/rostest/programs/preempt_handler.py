#!/usr/bin/env python
"""In a thread, with set_preempt_handler; the preempt is a Ctrl-C."""

import os
import signal
import threading

import rospy
from working import Step, Work, line, say, telling

import smach_ros


def main():
    rospy.init_node('preempt_handler')
    work = Work(stop=lambda: os.kill(os.getpid(), signal.SIGINT))
    machine = line(('FIRST', Step('FIRST')), ('WORK', work), ('LAST', Step('LAST')))
    machine.userdata.count = 0
    smach_ros.set_preempt_handler(telling('TOP', machine))
    # built: machine
    thread = threading.Thread(target=lambda: say('OUTCOME', machine.execute()))
    thread.start()
    while thread.is_alive():
        thread.join(0.1)  # so that the main thread hears signals
    say('JOINED')


main()
