"""Small helpers for scripts."""

import _thread
import inspect
import signal
import threading
import time
from types import FrameType
from typing import Any, Optional

import rospy

import smach

STOP_WITHIN_S = 10.0
"""How long a shutdown waits for a preempted machine to end by itself."""


def _executes_beneath_us(container: Any) -> bool:
    """Whether this very thread is inside ``container.execute``: waiting for its end here would wait
    forever.
    """
    frame: Optional[FrameType] = inspect.currentframe()
    while frame is not None:
        if frame.f_code.co_name == 'execute' and frame.f_locals.get('self') is container:
            return True
        frame = frame.f_back
    return False


def _is_running(container: Any) -> bool:
    return bool(container.is_running()) if hasattr(container, 'is_running') else False


def _preempt(container: Any) -> None:
    asked = []

    def ask() -> None:
        try:
            container.request_preempt()
        finally:
            asked.append(True)

    # The handler may have interrupted the executing thread while that held the machine's lock: ask
    # from another one. Where it has interrupted threading, a Thread could not be started.
    _thread.start_new_thread(ask, ())
    if _executes_beneath_us(container):
        return
    give_up_at = time.monotonic() + STOP_WITHIN_S
    while (not asked or _is_running(container)) and time.monotonic() < give_up_at:
        time.sleep(0.02)
    if _is_running(container):
        smach.logwarn(
            'The machine did not end within %g s of its preempt; shutting down without it'
            % STOP_WITHIN_S
        )


def set_preempt_handler(sc: Any) -> None:
    """Preempt container ``sc`` when Ctrl-C (SIGINT) or any other shutdown of the node is requested.

    A machine that runs in another thread is given ten seconds to end by itself before the shutdown
    goes on. Where rospy was told to leave signals alone (``disable_signals=True``), a SIGINT
    preempts the container and nothing else.
    """
    rospy.on_shutdown(lambda: _preempt(sc))
    rospy_has_signals = signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    if rospy_has_signals or not rospy.core.is_initialized():
        return
    if threading.current_thread() is threading.main_thread():
        signal.signal(
            signal.SIGINT, lambda number, frame: _thread.start_new_thread(sc.request_preempt, ())
        )
