"""Recovery from failures for SMACH state machines, with a human expert as the last resort.

`OracleContainer` is the ROS-attached one where rospy is installed, else the bare one. It is looked
up on first use, so that `smach_oracle.analysis` needs neither ROS nor SMACH.
"""

from typing import Any

__all__ = ['OracleContainer']
__version__ = '0.2.0'  # as in package.xml


def __getattr__(name: str) -> Any:
    if name != 'OracleContainer':
        raise AttributeError('module {!r} has no attribute {!r}'.format(__name__, name))
    try:
        import rospy  # noqa: F401
    except ImportError:
        from smach_oracle.oracle import OracleContainer
    else:
        from smach_oracle.ros.container import OracleContainer
    globals()[name] = OracleContainer
    return OracleContainer
