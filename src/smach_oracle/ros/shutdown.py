"""Ends the process in order, and in time, on SIGINT and SIGTERM.

The machines are preempted, the questions taken back and the bags closed. The process is gone within
two seconds even where a state never returns, or so much later as the setting `after_preempt_s`
gives the states behind a preempt.

The guard hears a signal while the main thread sits in a C call that never comes back. What the
process does with the signal otherwise (rospy's handler, KeyboardInterrupt) stays as it is. Where
states behind a preempt may run, that waits for them.
"""

import os
import signal
import sys
import threading
import time
from types import FrameType, TracebackType
from typing import Any, Callable, Dict, Optional, TextIO, TypeVar

from smach_oracle.forking import in_child

from .signals.child_processes import end_program
from .signals.latch import Latch, start_thread
from .signals.signal_ear import SignalEar

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
    :param after_preempt_s: says how long the machines that run may go on after they are preempted.
        The handler of the signal waits until `trials_ended`, or so long, or until a second signal.
    """

    def __init__(
        self,
        preempt: Callable[[], None],
        close: Callable[[float], None],
        end: Callable[[int], None] = end_program,
        limit_s: float = LIMIT_S,
        after_preempt_s: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self._preempt = preempt
        self._close = close
        self._end = end
        self._limit_s = limit_s
        self._after_preempt_s = after_preempt_s
        self._lock = threading.RLock()  # a signal's handler may interrupt its holder
        self._armed = False
        self._hold_s: Optional[float] = None  # how long a handler may wait, once that is known
        self._held: Optional[int] = None  # the signal whose handler waits
        self._no_hold = Latch()  # no handler is to wait any longer
        self._handled = Latch()
        self._handlers: Dict[int, Any] = {}  # by signal, as the script has set them

    def install(self) -> None:
        """Listen for signals from now on. Call it in the main thread.

        SIGTERM, which would end the process on the spot, becomes SystemExit in the main thread. A
        handler that is installed later (rospy.init_node's among them) overrides that. The guard
        hears the signal anyway.
        """
        ear = SignalEar()
        self._signal, self._getsignal = signal.signal, signal.getsignal
        for number in SIGNALS:
            self._put_handler(number, self._getsignal(number))
        setattr(signal, 'signal', self._signal_for_script)
        setattr(signal, 'getsignal', self._getsignal_for_script)
        in_child(self._let_go)
        threading.Thread(
            target=self._listen, args=(ear,), name='shutdown_guard', daemon=True
        ).start()

    def arm(self, exit_code: int) -> None:
        """Preempt now and end the process by force after the limit.

        Only the first call takes effect. Any thread may use it.
        """
        hold_s = self._hold()
        with self._lock:
            is_first, self._armed = not self._armed, True
        if is_first:
            started = time.monotonic()
            start_thread(self._preempt)
            start_thread(lambda: self._end_in_time(started, hold_s, exit_code))

    def _hold(self) -> float:
        """Return for how many seconds a handler may wait. The first signal decides."""
        with self._lock:
            if self._hold_s is None:
                self._hold_s = self._after_preempt_s()
                if self._hold_s <= 0:
                    self._no_hold.set()
            return self._hold_s

    def trials_ended(self) -> None:
        """Let the signal's handler run, where it has waited for the trials of the process.

        It returns when that is done, so that the script begins no other trial before.
        """
        with self._lock:
            if self._hold_s is None or self._no_hold.is_set():
                return
            self._no_hold.set()  # first: from here on a handler does not wait
            waits = self._held is not None
        if not waits:
            return
        self._deliver()
        if threading.current_thread() is not threading.main_thread():
            self._handled.wait(self._limit_s)

    def holds(self) -> bool:
        """Whether a signal has come whose handler waits for trials, or runs now."""
        return bool(self._hold_s) and not self._handled.is_set()

    def wait_for_handler(self) -> None:
        """Wait until the handler has run, where it waits for trials. Others may still run."""
        if self.holds():
            self._no_hold.wait()
            if self._held is not None:
                self._handled.wait(self._limit_s)

    def _listen(self, ear: SignalEar) -> None:
        while True:
            for number in ear.wait():
                if number in SIGNALS and _means_the_end(number, self._handlers[number]):
                    if self._armed:
                        self._no_hold.set()
                    self.arm(128 + number)

    def _end_in_time(self, started: float, hold_s: float, exit_code: int) -> None:
        if not self._no_hold.wait(hold_s):
            self._no_hold.set()
            self._deliver()
        if hold_s > 0:
            started = time.monotonic()
        time.sleep(max(0.0, started + self._limit_s - CLOSING_S - time.monotonic()))
        # Only a process that does not end by itself is still here: this thread is a daemon.
        _within(CLOSING_S, self._close, CLOSING_S)
        for stream in (sys.stdout, sys.stderr):
            _within(0.1, _flush, stream)
        self._end(exit_code)

    # -- handlers

    def _put_handler(self, number: int, handler: Any) -> None:
        if handler is not None:  # one that C code has put there stays
            self._signal(number, self._handle if _means_the_end(number, handler) else handler)
        self._handlers[number] = handler

    def _signal_for_script(self, number: int, handler: Any) -> Any:
        """Do for a script what `signal.signal` does."""
        if number not in SIGNALS:
            return self._signal(number, handler)
        before = self._handlers[number]
        self._put_handler(number, handler)
        return before

    def _getsignal_for_script(self, number: int) -> Any:
        return self._handlers[number] if number in SIGNALS else self._getsignal(number)

    def _handle(self, number: int, frame: Optional[FrameType]) -> None:
        """Do what the script's handler does, now or once the states behind a preempt have run."""
        # no thread is started here, nor waited for: the main thread may hold what that takes
        self._hold()
        with self._lock:
            waits = self._held is None and not self._no_hold.is_set()
            if waits:
                self._held = number
            else:
                self._no_hold.set()
        if not waits:
            self._call_handler(number, frame)

    def _call_handler(self, number: int, frame: Optional[FrameType]) -> None:
        handler = self._handlers[number]
        try:
            if callable(handler):
                handler(number, frame)
            elif handler == signal.SIG_DFL:
                raise SystemExit(128 + number)
        finally:
            self._handled.set()

    def _deliver(self) -> None:
        """Let the handler that has waited run in the main thread."""
        number = self._held
        if number is None:
            return
        if threading.current_thread() is threading.main_thread():
            self._call_handler(number, None)
        else:
            os.kill(os.getpid(), number)

    def _let_go(self) -> None:
        """Leave a child with the handlers that it would have without the guard."""
        setattr(signal, 'signal', self._signal)
        setattr(signal, 'getsignal', self._getsignal)
        for number, handler in self._handlers.items():
            if handler is not None:
                self._signal(number, handler)


def hide_from(trace: Optional[TracebackType]) -> None:
    """Let a traceback end where a signal met the script, as it does without a guard."""
    while trace is not None:
        if trace.tb_next is not None and trace.tb_next.tb_frame.f_code.co_filename == __file__:
            trace.tb_next = None
        trace = trace.tb_next


def _means_the_end(number: int, handler: Any) -> bool:
    """Whether a handler ends the process: a script with one of its own knows what it wants."""
    if isinstance(handler, int):
        return number == signal.SIGTERM and handler == signal.SIG_DFL
    function = getattr(handler, 'func', handler)  # asyncio's is a functools.partial
    return function is signal.default_int_handler or getattr(function, '__module__', '') in (
        'rospy.core',
        'asyncio.runners',
    )


def _within(limit_s: float, function: Callable[[Argument], object], argument: Argument) -> None:
    """Call it, but wait no longer than the limit.

    A full disk or a pipe that nobody reads must not hold the end up.
    """
    start_thread(lambda: function(argument)).wait(limit_s)


def _flush(stream: TextIO) -> None:
    try:
        stream.flush()
    except (OSError, ValueError, AttributeError):  # closed, broken or replaced by the script
        pass
