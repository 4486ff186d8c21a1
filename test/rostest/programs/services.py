#!/usr/bin/env python
"""A ServiceState, whose service does not always do what it is asked, and a MonitorState."""

import rospy
from std_msgs.msg import Int32
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse
from working import OUTCOMES, ending, say, telling

import smach
import smach_ros

calls = []


def serve(request):
    calls.append(request.data)
    say('CALL')
    how = ending()
    if how == 'preempted':
        machine.request_preempt()
    if how in ('well', 'preempted') or len(calls) > 1 and not how.startswith('always'):
        return SetBoolResponse(True, 'done')
    say('GRIPPER does not succeed')
    return None if how.endswith('raises') else SetBoolResponse(False, 'the gripper is stuck')


def judge(ud, response):
    ud.text = response.message
    return 'succeeded' if response.success else 'aborted'


rospy.init_node('services')
rospy.Service('~gripper', SetBool, serve)
ticks = rospy.Publisher('~ticks', Int32, queue_size=1, latch=True)
ticks.publish(3)
machine = smach.StateMachine(OUTCOMES)
with machine:
    smach.StateMachine.add(
        'READY',
        smach_ros.MonitorState(
            '~ticks', Int32, lambda ud, message: message.data != 3, max_checks=1
        ),
        {'invalid': 'GRIPPER', 'valid': 'aborted'},
    )
    smach.StateMachine.add(
        'GRIPPER',
        smach_ros.ServiceState(
            '~gripper', SetBool, SetBoolRequest(True), response_cb=judge, output_keys=['text']
        ),
        {'succeeded': 'WATCH'},
    )
    smach.StateMachine.add(
        'WATCH',
        smach_ros.MonitorState(
            '~ticks', Int32, lambda ud, message: message.data == 3, max_checks=1
        ),
        {'valid': 'succeeded', 'invalid': 'aborted'},
    )
telling('TOP', machine)
# built: machine
outcome = machine.execute()
say('OUTCOME', outcome, machine.userdata.text if 'text' in machine.userdata else None)
