"""A state that watches a topic."""

import threading
import traceback
from typing import Any, Callable, Iterable, Optional

import rosgraph
import rospy

import smach
from smach_ros.waiting import Aside, Signal

__all__ = ['MonitorState']

LOOK_FOR_MASTER_S = 0.2


class MonitorState(smach.State):
    """Ends 'invalid' at the first message on ``topic`` for which ``cond_cb(userdata, message)`` is
    false.

    Ends 'valid' once ``max_checks`` messages were true (below 1: never), 'preempted' on a preempt
    or a shutdown. An exception in ``cond_cb`` is logged and counts as false. Messages are judged in
    the order they arrive in, in the subscriber's thread, so that a slow ``cond_cb`` does not delay
    a preempt.
    """

    def __init__(
        self,
        topic: str,
        msg_type: Any,
        cond_cb: Callable[[Any, Any], Any],
        max_checks: int = -1,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        smach.State.__init__(
            self,
            outcomes=['valid', 'invalid', 'preempted'],
            input_keys=list(input_keys),
            output_keys=list(output_keys),
        )
        self._topic = topic
        self._msg_type = msg_type
        self._cond_cb = cond_cb
        self._max_checks = max_checks
        self._signal = Signal()

    def request_preempt(self) -> None:
        """Ask to stop. Noticed at once, and never lost if it comes before ``execute``."""
        smach.State.request_preempt(self)
        self._signal.notify()

    def execute(self, ud: Any) -> str:
        """Watch until a verdict, a preempt or a shutdown."""
        if self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        watch = _Watch(self._cond_cb, self._max_checks, ud, self._signal)
        listening = Aside(
            'monitor %s' % self._topic, self._signal, lambda stopped: self._listen(watch, stopped)
        )
        self._signal.wait(
            lambda: watch.verdict is not None or listening.ended or self.preempt_requested()
        )
        listening.stop()
        verdict = watch.close()
        if listening.error is not None:
            raise listening.error
        if verdict is None or self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        return verdict

    def _listen(self, watch: '_Watch', stopped: threading.Event) -> None:
        while not rosgraph.is_master_online():
            # rospy would try to subscribe until it is back, and hold a lock that a shutdown of the
            # node waits for
            if stopped.wait(LOOK_FOR_MASTER_S):
                return
        subscriber = rospy.Subscriber(self._topic, self._msg_type, callback=watch.judge)
        stopped.wait()
        subscriber.unregister()


class _Watch(object):
    """One execution: counts and judges the messages that arrive while it is open."""

    def __init__(
        self, cond_cb: Callable[[Any, Any], Any], max_checks: int, ud: Any, signal: Signal
    ) -> None:
        self.verdict: Optional[str] = None
        self._cond_cb = cond_cb
        self._max_checks = max_checks
        self._ud = ud
        self._signal = signal
        self._true_checks = 0
        self._open = True
        self._lock = threading.Lock()

    def judge(self, message: Any) -> None:
        with self._lock:
            if not self._open or self.verdict is not None:
                return
            holds = self._holds(message)
            if not holds:
                self.verdict = 'invalid'
            else:
                self._true_checks += 1
                if self._true_checks == self._max_checks:
                    self.verdict = 'valid'
            if self.verdict is None:
                return
        self._signal.notify()

    def close(self) -> Optional[str]:
        """Judge nothing any more. Does not wait for a callback that is at work."""
        self._open = False
        return self.verdict

    def _holds(self, message: Any) -> bool:
        try:
            return bool(self._cond_cb(self._ud, message))
        except Exception:
            smach.logerr(
                'Condition callback %r raised; its message counts as invalid:\n%s'
                % (self._cond_cb, traceback.format_exc())
            )
            return False
