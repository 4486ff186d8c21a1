"""States and tools that join SMACH machines to ROS.

Importing this package sends SMACH's log lines to rospy's loggers and lets machines stop when rospy
shuts down.
"""

import rospy
import smach

smach.set_loggers(rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr)
smach.set_shutdown_check(rospy.is_shutdown)

from smach_ros.util import set_preempt_handler  # noqa: E402
from smach_ros.simple_action_state import SimpleActionState  # noqa: E402
from smach_ros.service_state import ServiceState  # noqa: E402
from smach_ros.monitor_state import MonitorState  # noqa: E402
from smach_ros.condition_state import ConditionState  # noqa: E402
from smach_ros.action_server_wrapper import ActionServerWrapper  # noqa: E402
from smach_ros.introspection import IntrospectionClient, IntrospectionServer  # noqa: E402

__all__ = [
    'set_preempt_handler',
    'SimpleActionState',
    'ServiceState',
    'MonitorState',
    'ConditionState',
    'ActionServerWrapper',
    'IntrospectionServer',
    'IntrospectionClient',
]
