"""Waits of the oracle that are passed through a service: `~pass_time`, a PassTime.

A simulated world that stands still while nobody moves would otherwise be the same after a wait. A
real robot has no such service, and simply waits.
"""

import time
from typing import Optional

import rospy

from smach_oracle.oracle.scope.scope import Scope, Waiting
from smach_oracle.srv import PassTime, PassTimeRequest

from ..log.said_once import warn_once
from ..service_calls import ServerGoneError, ServiceCall

_PIECE_S = 1.0  # a preempt is heeded between pieces
_LOOK_S = 0.05
_LIMIT_S = 60.0  # of one call. Physics may have to be computed
_ENOUGH = 0.99  # share of the time, for what the clock's messages are late


class ServiceWaiting(Waiting):
    """Lets time pass by a service, and by waiting where that has let none pass."""

    def __init__(self, service: str, by_itself: Optional[Waiting] = None) -> None:
        """`service`: resolved name of a PassTime service. `by_itself`: waits without it."""
        self._service = service
        self._by_itself = by_itself or Waiting()

    def wait(self, seconds: float, what: str, scope: Scope) -> None:
        """Wait so many seconds, or until `scope` is cancelled."""
        left_s = seconds
        while left_s > 0 and scope.reason is None:
            piece_s = min(left_s, _PIECE_S)
            passed_s = self._pass(piece_s, what, scope)
            if passed_s is None:
                self._by_itself.wait(left_s, what, scope)
                return
            if passed_s < _ENOUGH * piece_s:  # a world with a pace of its own
                self._by_itself.wait(piece_s - passed_s, what, scope)
            left_s -= piece_s

    def _pass(self, seconds: float, what: str, scope: Scope) -> Optional[float]:
        """Let time pass, and return how many s it was, None where the service does not do so."""
        begun_s, until_s = rospy.get_time(), time.monotonic() + _LIMIT_S
        call = ServiceCall(self._service, PassTime, PassTimeRequest(seconds, what))
        while call.is_alive() and time.monotonic() < until_s:
            if scope.reason is not None:
                return seconds
            call.join(_LOOK_S)
        try:
            return max(0.0, float(call.result(0.0).stamp.to_sec()) - begun_s)
        except ServerGoneError as err:
            warn_once('{}; the oracle waits without it. This is said once'.format(err))
            return None
