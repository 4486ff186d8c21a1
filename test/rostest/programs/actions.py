#!/usr/bin/env python
"""Two SimpleActionStates with goal slots and callbacks; their server is in the same process."""

import actionlib
import rospy
from actionlib.msg import TestAction, TestGoal, TestResult
from actionlib_msgs.msg import GoalStatus
from working import OUTCOMES, ending, say, telling

import smach
from smach_ros import SimpleActionState

goals = []


def serve(goal):
    goals.append(goal.goal)
    say('GOAL', goal.goal)
    rospy.sleep(0.1)  # a motion takes its time; actionlib's client gets lost where it takes none
    how = ending()
    if how == 'preempted' and len(goals) == 1:
        machine.request_preempt()
        pause = rospy.Rate(100)
        while not server.is_preempt_requested() and not rospy.is_shutdown():
            pause.sleep()  # until the cancel has arrived
        server.set_preempted()
    elif how.endswith('fails') and (len(goals) == 1 or how.startswith('always')):
        say('MOVE does not succeed')
        server.set_aborted()
    else:
        server.set_succeeded(TestResult(10 * goal.goal))


made = []


def goal_of(ud, goal):
    made.append(goal)
    if ending().endswith('raises') and (len(made) == 1 or ending().startswith('always')):
        say('MOVE does not succeed')
        raise ValueError('no goal can be made')
    return TestGoal(ud.place)


def take(ud, status, result):
    if status == GoalStatus.SUCCEEDED:
        ud.place = result.result
        say('RESULT', result.result)


rospy.init_node('actions')
server = actionlib.SimpleActionServer('~move', TestAction, serve, auto_start=False)
server.start()
machine = smach.StateMachine(OUTCOMES)
machine.userdata.place = 1
with machine:
    smach.StateMachine.add(
        'MOVE',
        SimpleActionState(
            '~move',
            TestAction,
            goal_cb=goal_of,
            result_cb=take,
            input_keys=['place'],
            output_keys=['place'],
        ),
        {'succeeded': 'BACK'},
    )
    smach.StateMachine.add(
        'BACK',
        SimpleActionState('~move', TestAction, goal_slots=['goal'], result_slots=['result']),
        remapping={'goal': 'place', 'result': 'place'},
    )
telling('TOP', machine)
# built: machine
try:
    say('OUTCOME', machine.execute(), machine.userdata.place)
finally:
    rospy.signal_shutdown('or the server goes on')
