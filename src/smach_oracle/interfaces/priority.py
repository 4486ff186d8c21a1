"""A node's share of a busy machine: its nice value, where the system allows it."""

import os
import time
from pathlib import Path

import rospy

from smach_oracle.ros.parameters import number_of

NICE = -10
"""The nice value of a node that a person waits for. It gets 9/10 of a core next to nice 0."""

_THREADS = Path('/proc/self/task')
# where the system shares its time by sessions first, a nice value counts within a session alone
_SESSION = Path('/proc/self/autogroup')


def take_priority() -> None:
    """Take the nice value of the parameter ~nice, -20 (first) to 19 (last). 0 leaves it as it is.

    To go before others needs a right that only root has by itself. Without it the node goes on as
    it is. Call it once the node has begun: it counts for the threads that there are, and for those
    that they start.

    :raises SettingsError: for another value of ~nice.
    """
    wanted = int(number_of('~nice', NICE, -20, 19))
    if wanted and not set_nice(wanted):
        rospy.loginfo(
            '%s: nice %d is not allowed here; beside a busy core it may be slow',
            rospy.get_name(),
            wanted,
        )


def set_nice(nice: int) -> bool:
    """Give all threads of this process a nice value. Return whether the system allows it.

    It counts among all processes where this one has a session of its own, as roslaunch gives it.
    """
    try:
        for thread in _THREADS.iterdir():
            try:
                os.setpriority(os.PRIO_PROCESS, int(thread.name), nice)
            except ProcessLookupError:
                continue  # it has ended meanwhile
        if os.getsid(0) == os.getpid() and _SESSION.exists():  # a session of its own
            _set_session(nice)
    except OSError:
        return False
    return True


def _set_session(nice: int) -> None:
    """The system takes ten such changes a second, of all processes together."""
    for _ in range(20):
        try:
            _SESSION.write_text(str(nice), encoding='ascii')
            return
        except BlockingIOError:
            time.sleep(0.1)
