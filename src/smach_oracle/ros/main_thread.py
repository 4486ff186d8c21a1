"""Calls to the ROS master, kept out of the main thread.

rospy's proxy of the master has one lock, which is not re-entrant, and rospy's own handler of a
signal takes it: a signal that meets the main thread within a call to the master hangs the process
for good. In another thread the call ends while the handler waits for the lock.
"""

import threading
from typing import Callable, List, TypeVar

import rospy

from smach_oracle.oracle.scope.background_call import BackgroundCall
from smach_oracle.oracle.scope.scope import Scope

_LOOK_S = 0.1
SHUTDOWN_WAIT_S = 2.0  # for a call that had begun before the shutdown was requested

Result = TypeVar('Result')


def outside_main_thread(function: Callable[[], Result]) -> Result:
    """Return what a function returns, or raise what it raises. Wait for it.

    It runs in a thread of its own where the caller is the main thread of a node, and else in the
    caller's: without a node rospy handles no signals.

    :raises rospy.ROSInterruptException: where the node shuts down, and the function has not
        returned 2 s later.
    """
    if threading.current_thread() is not threading.main_thread() or not rospy.core.is_initialized():
        return function()
    results: List[Result] = []
    call = BackgroundCall(lambda: results.append(function()), 'calls the master')
    call.start()
    looks_left = SHUTDOWN_WAIT_S / _LOOK_S
    while not Scope().wait(_LOOK_S, call.done):
        looks_left -= rospy.core.is_shutdown_requested()
        if looks_left <= 0:
            raise rospy.ROSInterruptException('the node shuts down; the master has not answered')
    call.returned()
    return results[0]
