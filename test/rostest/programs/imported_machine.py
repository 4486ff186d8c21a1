#!/usr/bin/env python
"""The machine lies in another module, which executes it as well."""

import robot_machines
import rospy
from working import say

rospy.init_node('imported_machine')
# built: robot_machines.fetch
say('OUTCOME', robot_machines.run(), robot_machines.fetch.userdata.count)
