#!/usr/bin/env python
"""Imports SMACH, and has no machine."""

import os
import signal
import sys

import rospy
from working import ending, say

import smach  # noqa: F401

rospy.init_node('no_machine')
say('PARAMETER', rospy.get_param('~speed', 'none'))
if ending().endswith('raises'):
    raise ValueError('as it is told')
if ending() == 'preempted':
    os.kill(os.getpid(), signal.SIGINT)
    rospy.spin()
say('OUTCOME', ending().split()[-1])
if ending().endswith('fails'):
    sys.exit('it has failed')
