#!/usr/bin/env python3
"""Executes a MonitorState, and an action state, that begin while the master (a child process) is
away, until Ctrl-C.
"""

import os
import signal
import sys
import threading

import rospy
from actionlib.msg import TestAction
from std_msgs.msg import Int32
from waiting import Once, waits

import smach
from smach_ros import MonitorState, SimpleActionState

if __name__ == '__main__':
    rospy.init_node('masterless')
    os.kill(int(sys.argv[1]), signal.SIGKILL)
    action = SimpleActionState('absent', TestAction)
    aside = threading.Thread(target=action.execute, args=(smach.UserData(),), daemon=True)
    aside.start()
    Once(
        lambda: waits(aside) and waits(threading.main_thread()),
        lambda: print('waiting', flush=True),
    )
    print(
        'ended:',
        MonitorState('numbers', Int32, lambda ud, message: True).execute(smach.UserData()),
        flush=True,
    )
