#!/usr/bin/env python3
"""A task for oracle_run that goes round until a file called stop is there: it moves, fails, goes
where an expert sends it, and tells a journal so.

Run as ``oracle_run killed_robot.py FOLDER NUMBER``. The states bear the robot's number, so that an
answer for another robot cannot be followed.
"""

import json
import os
import sys

import rospy
from actionlib.msg import TestAction, TestGoal

import smach
import smach_ros

FOLDER, NUMBER = sys.argv[1], sys.argv[2]
JOURNAL = os.path.join(FOLDER, 'journal')
SUCCEED = 150  # number of a goal
rospy.init_node('robot')


def tell(**line):
    """Add a line to the journal, on the disk before this returns."""
    journal = os.open(JOURNAL, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    os.write(journal, (json.dumps(dict(line, robot=NUMBER, process=os.getpid())) + '\n').encode())
    os.fsync(journal)
    os.close(journal)


def rounds():
    """The rounds that this robot has told."""
    if not os.path.exists(JOURNAL):
        return set()
    with open(JOURNAL) as stream:
        return {
            line['round']
            for line in map(json.loads, stream)
            if line['robot'] == NUMBER and line['what'] == 'round'
        }


class Work(smach.State):
    """Always fails."""

    def __init__(self):
        smach.State.__init__(self, ['succeeded', 'aborted'])

    def execute(self, userdata):
        return 'aborted'


class Tell(smach.State):
    """Ends one round."""

    def __init__(self):
        smach.State.__init__(self, ['again', 'succeeded', 'aborted'], ['round'], ['round'])

    def execute(self, userdata):
        tell(what='round', round=userdata.round)
        userdata.round = userdata.round + 1
        return 'succeeded' if os.path.exists(os.path.join(FOLDER, 'stop')) else 'again'


sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
sm.userdata.round = len(rounds())  # where a new trial begins
with sm:
    smach.StateMachine.add(
        'MOVE_' + NUMBER,
        smach_ros.SimpleActionState('/arm', TestAction, goal=TestGoal(SUCCEED)),
        {'succeeded': 'WORK_' + NUMBER},
    )
    smach.StateMachine.add('WORK_' + NUMBER, Work(), {'succeeded': 'aborted'})
    smach.StateMachine.add('TELL_' + NUMBER, Tell(), {'again': 'MOVE_' + NUMBER})
tell(what='begins')
outcome = ''
while outcome != 'succeeded':  # a question that has expired ends a trial
    outcome = sm.execute()
    if outcome is None or rospy.is_shutdown():
        sys.exit(1)
tell(what='ended', outcome=outcome)
