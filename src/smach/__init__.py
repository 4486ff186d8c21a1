"""SMACH: build hierarchical state machines in Python and run them.

A machine is a container of states. A state does its work in ``execute`` and returns one of its
outcomes. The container maps (state, outcome) to the next state or to an outcome of its own. This
package knows nothing of ROS.
"""

# The names below are looked up here at every use (smach.loginfo, smach.is_shutdown), so that
# replacing one of them replaces it everywhere. Hence this module must have them before the others
# are imported.
from smach.log import logdebug, logerr, loginfo, logwarn, set_loggers
from smach.exceptions import (
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
)
from smach.util import (
    CBInterface,
    cb_interface,
    has_smach_interface,
    is_shutdown,
    set_shutdown_check,
)
from smach.user_data import Remapper, UserData
from smach.state import CBState, State
from smach.container import Container
from smach.state_machine import StateMachine
from smach.sequence import Sequence
from smach.concurrence import Concurrence
from smach.iterator import Iterator

__all__ = [
    'CBInterface',
    'CBState',
    'Concurrence',
    'Container',
    'InvalidConstructionError',
    'InvalidStateError',
    'InvalidTransitionError',
    'InvalidUserCodeError',
    'Iterator',
    'Remapper',
    'Sequence',
    'SmachError',
    'State',
    'StateMachine',
    'UserData',
    'cb_interface',
    'has_smach_interface',
    'is_shutdown',
    'logdebug',
    'logerr',
    'loginfo',
    'logwarn',
    'set_loggers',
    'set_shutdown_check',
]
