#!/usr/bin/env python3
"""One trial of a use case for oracle_run, in a world as it stands: nothing is reset.

Run as ``oracle_run killed_pr2_robot.py TASK JOURNAL``. The journal gets ``begun`` before the
machine begins, and ``ended OUTCOME`` after it.
"""

import importlib
import os
import sys

import rospy

import smach

TASK, JOURNAL = sys.argv[1], sys.argv[2]


def tell(text: str) -> None:
    """Add a line to the journal, on the disk before this returns."""
    with open(JOURNAL, 'a') as stream:
        stream.write(text + '\n')
        stream.flush()
        os.fsync(stream.fileno())


rospy.init_node(TASK)
task = importlib.import_module('smach_oracle.tasks.' + TASK)
sm = task.make_machine()
sm.userdata = smach.UserData()
if TASK == 'pick_and_place':
    sm.userdata.place_pose = task.place_pose()
tell('begun')
outcome = sm.execute()
if not rospy.is_shutdown():
    tell('ended {}'.format(outcome))
