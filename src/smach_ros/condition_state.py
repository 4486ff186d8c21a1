"""A state that polls a condition."""

import time
import traceback
from typing import Any, Callable, Iterable

import rospy

import smach
from smach_ros.waiting import Signal, deadline_after, seconds, shutting_down

__all__ = ['ConditionState']


class ConditionState(smach.State):
    """Ends 'true' as soon as ``cond_cb(userdata)`` is, 'false' when it stays false, 'preempted' on
    a preempt.

    ``poll_rate`` is the pause between checks and ``timeout`` the limit of the whole wait
    (``rospy.Duration`` or seconds of wall time, no timeout: None or 0). ``max_checks`` more checks
    follow a first false one. -1 means without end. ``execute`` raises InvalidUserCodeError if
    ``cond_cb`` raises.
    """

    def __init__(
        self,
        cond_cb: Callable[[Any], Any],
        input_keys: Iterable[str] = (),
        poll_rate: Any = rospy.Duration(0.05),
        timeout: Any = None,
        max_checks: int = 1,
    ) -> None:
        smach.State.__init__(
            self, outcomes=['true', 'false', 'preempted'], input_keys=list(input_keys)
        )
        if smach.has_smach_interface(cond_cb):  # its outcomes are not the state's
            self.register_input_keys(cond_cb.get_registered_input_keys())
            self.register_output_keys(cond_cb.get_registered_output_keys())
        self._cond_cb = cond_cb
        self._poll_rate = poll_rate
        self._timeout = timeout
        self._max_checks = max_checks
        self._signal = Signal()

    def request_preempt(self) -> None:
        """Ask to stop. A pause between checks ends at once."""
        smach.State.request_preempt(self)
        self._signal.notify()

    def execute(self, ud: Any) -> str:
        """Check until the condition holds or patience ends."""
        pause_s = seconds(self._poll_rate)
        deadline = deadline_after(seconds(self._timeout) or None)
        checks = 0
        while not self.preempt_requested() and not shutting_down():
            if self._holds(ud):
                return 'true'
            checks += 1
            if 0 <= self._max_checks < checks or (
                deadline is not None and time.monotonic() >= deadline
            ):
                return 'false'
            self._signal.wait(self.preempt_requested, deadline, pause_s)
        self.service_preempt()
        return 'preempted'

    def _holds(self, ud: Any) -> bool:
        try:
            return bool(self._cond_cb(ud))
        except Exception as err:
            raise smach.InvalidUserCodeError(
                'Condition callback %r raised:\n%s' % (self._cond_cb, traceback.format_exc())
            ) from err
