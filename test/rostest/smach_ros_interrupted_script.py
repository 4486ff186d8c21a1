#!/usr/bin/env python3
"""A script that waits for a message that never comes, for tests that press Ctrl-C."""

import sys
import threading

import rospy
from std_msgs.msg import Empty

import smach
from smach_ros import MonitorState, set_preempt_handler


def main(where, handler):
    rospy.init_node('interrupted_script', anonymous=True, disable_signals=handler == 'unsignalled')
    machine = smach.StateMachine(outcomes=['valid', 'invalid', 'preempted'])
    up = ['not told']

    def tell_when_it_waits(ud, states):
        threading.Timer(  # nothing shows that the subscriber is registered
            0.5, print, ['waiting'], {'flush': True}
        ).start()

    with machine:
        smach.StateMachine.add('WAIT', MonitorState('never', Empty, lambda ud, message: True))
    machine.register_start_cb(tell_when_it_waits, [])
    machine.register_termination_cb(
        lambda ud, states, outcome: up.append(not rospy.is_shutdown()), []
    )
    if handler != 'none':
        set_preempt_handler(machine)
    outcomes = []
    if where == 'thread':
        thread = threading.Thread(target=lambda: outcomes.append(machine.execute()))
        thread.start()
        thread.join()
    else:
        outcomes.append(machine.execute())
    print('ended: %s while up: %s' % (outcomes[0], up[-1]))


if __name__ == '__main__':
    main(*sys.argv[1:3])
