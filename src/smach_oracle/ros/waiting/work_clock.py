"""The clock of work under simulated time: a state takes what it takes in the world.

That is ROS time, unless the world tells its own. One in lock-step stands still while nobody moves,
and its /clock goes on, for those who sleep.
"""

import contextlib
import threading
import time
from typing import Iterator, Optional

import rospy
from rosgraph_msgs.msg import Clock as ClockMessage

from smach_oracle.oracle.scope.clock import Clock
from smach_oracle.oracle.scope.scope import Scope, Waiting

_FIRST_S = 1.0  # for the first message of a world that tells its time


class WorkClock(Clock):
    """Shows how much of the world's time has passed, as far as it has gone on.

    It never goes back: where the world's time does, as in a world that is reset, it goes on from
    there. Where that stands still, so does it. Safe to use from several threads.

    :param topic: resolved name of the Clock on which the world may tell its time, '' for none.
    """

    def __init__(self, topic: str = '') -> None:
        self._lock = threading.Lock()
        self._waits = 0  # under way in the machine's time
        self._shown_s = 0.0
        self._told_s = 0.0  # by the world, 0: it does not tell
        self._world_s, self._wall_s = rospy.get_time(), time.monotonic()
        if topic:
            self._is_told = threading.Event()
            rospy.Subscriber(topic, ClockMessage, self._hear, queue_size=1, tcp_nodelay=True)
            self._is_told.wait(_FIRST_S)

    def _hear(self, message: ClockMessage) -> None:
        told_s = float(message.clock.to_sec())
        if told_s <= 0:  # as in ROS time, 0 means that nothing was told
            return
        with self._lock:
            if not self._told_s:  # it has been ROS time until now
                self._count()
                self._world_s = told_s
            self._told_s = told_s
            self._count()
        self._is_told.set()

    def now(self) -> float:
        """Return the seconds that it shows."""
        with self._lock:
            return self._count()

    def pass_by(self, seconds: float) -> None:
        """Have it show so much more: a trial is replayed, and the world stands still meanwhile."""
        with self._lock:
            self._shown_s += seconds

    @contextlib.contextmanager
    def in_machines_time(self) -> Iterator[None]:
        """Have it go by the machine's time, whatever the world's does."""
        self._begin_waits(1)
        try:
            yield
        finally:
            self._begin_waits(-1)

    def _begin_waits(self, more: int) -> None:
        with self._lock:
            self._count()
            self._waits += more

    def _count(self) -> float:
        world_s, wall_s = self._told_s or rospy.get_time(), time.monotonic()
        if self._waits:
            self._shown_s += wall_s - self._wall_s
        elif self._world_s > 0:  # else no time had come yet
            self._shown_s += max(0.0, world_s - self._world_s)
        self._world_s, self._wall_s = world_s, wall_s
        return self._shown_s


def clock_of_work(pass_time: str) -> Optional[WorkClock]:
    """Return a clock of the world's time, None where this node goes by the machine's time.

    :param pass_time: name of the world's service, beside whose name it may tell its time, or ''.
    """
    if rospy.rostime.is_wallclock():
        return None
    if not pass_time:
        return WorkClock()
    return WorkClock(rospy.resolve_name(pass_time).rpartition('/')[0] + '/time')


class MachineTimeWaiting(Waiting):
    """Waits in the machine's time, and has the clock of work show that it took so long."""

    def __init__(self, clock: WorkClock) -> None:
        self._clock = clock

    def wait(self, seconds: float, what: str, scope: Scope) -> None:
        """Wait so many seconds, or until `scope` is cancelled."""
        with self._clock.in_machines_time():
            super().wait(seconds, what, scope)
