"""Steps that a thread of their own repeats until the node goes down."""

import threading
import time
from typing import Callable

import rosgraph
import rospy

from smach_oracle.ros.service_calls import ServerGoneError


def repeat(step: Callable[[], None], period_s: float) -> threading.Thread:
    """Start a thread that calls `step` again and again, with a pause of `period_s`.

    What one robot sends must not end it for the others: an error is logged, and the next call tries
    again.
    """
    thread = threading.Thread(target=_run, args=(step, period_s), name=step.__name__, daemon=True)
    thread.start()
    return thread


def _run(step: Callable[[], None], period_s: float) -> None:
    while not rospy.is_shutdown():
        try:
            step()
        except (OSError, rosgraph.MasterException, rospy.ROSException, ServerGoneError) as err:
            rospy.logdebug('%s did not succeed: %s', step.__qualname__, err)
        except Exception as err:
            rospy.logerr_throttle(10, '{} failed: {!r}'.format(step.__qualname__, err))
        time.sleep(period_s)
