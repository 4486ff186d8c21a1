#!/usr/bin/env python
"""Three machines in threads, one of which fails; an error of a thread is caught and said."""

import threading

import rospy
from working import Step, Work, line, say, telling

import smach

rospy.init_node('in_threads')
outcomes = {}


def build(name, how):
    work = Work(name + '_WORK', how=how)
    machine = telling(
        name, line(('LOOK', Step(name + '_LOOK')), ('WORK', work), ('PUT', Step(name + '_PUT')))
    )
    work.stop = machine.request_preempt
    machine.userdata.count = 0
    # built: machine
    return name, machine


def run(name, machine):
    try:
        outcomes[name] = machine.execute()
    except smach.InvalidUserCodeError as err:
        outcomes[name] = type(err).__name__


threads = [
    threading.Thread(target=run, args=build(*each))
    for each in (('LEFT', 'well'), ('RIGHT', None), ('HEAD', 'well'))
]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
say('OUTCOME', sorted(outcomes.items()))
