"""The ROS side of the smach viewer, under upstream's names.

The server is the one that the oracle uses, whichever smach_ros is installed.
"""

from smach_common.introspection.introspection_server import (
    INIT_TOPIC,
    STATUS_TOPIC,
    STRUCTURE_TOPIC,
    IntrospectionServer,
)
from smach_ros.introspection_client import IntrospectionClient

__all__ = [
    'IntrospectionServer',
    'IntrospectionClient',
    'STATUS_TOPIC',
    'INIT_TOPIC',
    'STRUCTURE_TOPIC',
]
