"""Ends the process in order, and in time, on SIGINT and SIGTERM.

The machines are preempted, the questions taken back and the bags closed. The process is gone within
two seconds even where a state never returns.

A signal reaches the guard through Python's wake-up file descriptor, written by the C-level handler,
so that it works while the main thread sits in a C call that never comes back. What the process does
with the signal otherwise (rospy's handler, KeyboardInterrupt) stays as it is.
"""
import os
import signal
import socket
import sys
import threading
import time
from types import FrameType
from typing import Callable, Optional, TextIO, TypeVar

LIMIT_S = 1.5  # from the signal to the end by force
CLOSING_S = 0.3  # of which for closing, where a machine did not end by itself
SIGNALS = (signal.SIGINT, signal.SIGTERM)

Argument = TypeVar('Argument')


class ShutdownGuard:
    """Preempts, waits, and ends the process by force where it does not end by itself.

    :param preempt: asks every machine of the process to stop. It is called in a thread of the
        guard's own, once.
    :param close: closes what must not be left open (bags), in at most the seconds given. It is
        called in the guard's thread before an end by force.
    """

    def __init__(self, preempt: Callable[[], None], close: Callable[[float], None],
                 end: Callable[[int], None] = os._exit, limit_s: float = LIMIT_S) -> None:
        self._preempt = preempt
        self._close = close
        self._end = end
        self._limit_s = limit_s
        self._armed = threading.Lock()
        self._wake_sender: Optional[socket.socket] = None  # kept: it is written to by number

    def install(self) -> None:
        """Listen for signals from now on. Call it in the main thread.

        SIGTERM, which would end the process on the spot, becomes SystemExit in the main thread. A
        handler that is installed later (rospy.init_node's among them) overrides that. The guard
        hears the signal anyway.
        """
        receiver, self._wake_sender = socket.socketpair()
        self._wake_sender.setblocking(False)
        signal.set_wakeup_fd(self._wake_sender.fileno(), warn_on_full_buffer=False)
        if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
            signal.signal(signal.SIGTERM, exit_on_sigterm)
        threading.Thread(target=self._listen, args=(receiver,), name='shutdown_guard',
                         daemon=True).start()

    def arm(self, exit_code: int) -> None:
        """Preempt now and end the process by force after the limit.

        Only the first call takes effect. Any thread may use it.
        """
        if self._armed.acquire(blocking=False):
            started = time.monotonic()
            threading.Thread(target=self._preempt, name='shutdown_preempt', daemon=True).start()
            threading.Thread(target=self._end_in_time, args=(started, exit_code),
                             name='shutdown_limit', daemon=True).start()

    def _listen(self, receiver: socket.socket) -> None:
        while True:
            for number in receiver.recv(64):
                if number in SIGNALS and _is_ours_to_act_on(number):
                    self.arm(128 + number)

    def _end_in_time(self, started: float, exit_code: int) -> None:
        time.sleep(max(0.0, started + self._limit_s - CLOSING_S - time.monotonic()))
        # Only a process that does not end by itself is still here: this thread is a daemon.
        _within(CLOSING_S, self._close, CLOSING_S)
        for stream in (sys.stdout, sys.stderr):
            _within(0.1, _flush, stream)
        self._end(exit_code)


def exit_on_sigterm(number: int, frame: Optional[FrameType]) -> None:
    """SIGTERM's handler in a process that is not a ROS node: unwind the main thread.

    rospy's handler calls the one before it. Then it is rospy that ends the process, and this one
    keeps quiet.
    """
    if signal.getsignal(number) is exit_on_sigterm:
        raise SystemExit(128 + number)


def _is_ours_to_act_on(number: int) -> bool:
    """Whether a signal means the end: a script with a handler of its own knows what it wants."""
    handler = signal.getsignal(number)
    if handler in (signal.default_int_handler, exit_on_sigterm):
        return True
    return getattr(handler, '__module__', '') == 'rospy.core'


def _within(limit_s: float, function: Callable[[Argument], object], argument: Argument) -> None:
    """Call it, but wait no longer than the limit.

    A full disk or a pipe that nobody reads must not hold the end up.
    """
    thread = threading.Thread(target=function, args=(argument,), daemon=True)
    thread.start()
    thread.join(limit_s)


def _flush(stream: TextIO) -> None:
    try:
        stream.flush()
    except (OSError, ValueError, AttributeError):  # closed, broken or replaced by the script
        pass
