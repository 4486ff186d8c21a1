#!/usr/bin/env python
"""A machine behind an ActionServerWrapper; a client sends two goals, and the script then ends."""

import actionlib
import rospy
from actionlib.msg import TestAction, TestGoal, TestResult
from working import OUTCOMES, Step, Work, ending, say, telling

import smach
from smach_ros import ActionServerWrapper

rospy.init_node('action_server')
client = actionlib.SimpleActionClient('~fetch', TestAction)
machine = smach.StateMachine(OUTCOMES, input_keys=['goal'], output_keys=['result'])
machine.userdata.count = 0


@smach.cb_interface(input_keys=['goal'], output_keys=['count', 'result'], outcomes=['succeeded'])
def read(ud):
    say('GOAL', ud.goal.goal)
    ud.count = ud.goal.goal
    ud.result = TestResult(2 * ud.goal.goal)
    return 'succeeded'


with machine:
    smach.StateMachine.add('READ', smach.CBState(read), {'succeeded': 'WORK'})
    smach.StateMachine.add('WORK', Work(stop=client.cancel_goal), {'succeeded': 'LAST'})
    smach.StateMachine.add('LAST', Step('LAST'))
telling('FETCH', machine)
# built: machine
wrapper = ActionServerWrapper(
    rospy.resolve_name('~fetch'),
    TestAction,
    machine,
    ['succeeded'],
    ['aborted'],
    ['preempted'],
    goal_key='goal',
    result_key='result',
)
wrapper.run_server()
assert client.wait_for_server(rospy.Duration(30.0))
for number in (7, 8):
    client.send_goal(TestGoal(number))
    assert client.wait_for_result(rospy.Duration(30.0)), ending()
    say('OUTCOME', client.get_state(), client.get_result().result)
rospy.signal_shutdown('done')
