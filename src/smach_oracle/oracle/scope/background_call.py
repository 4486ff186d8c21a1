"""Calls a function in a thread of its own, so that nobody has to wait for its end."""

import contextvars
import os
import queue
import threading
from typing import Callable, Optional

from .clock import Flag


class KeptThread:
    """A thread that makes one call after another, since to start one costs more than most calls.

    One caller has it at a time, and hands the next call over once the one before has ended.
    """

    def __init__(self, name: str) -> None:
        self._pid = os.getpid()
        self._calls: 'queue.SimpleQueue[Optional[Callable[[], None]]]' = queue.SimpleQueue()
        self.thread = _thread(self._work, name)
        self.thread.start()

    def begin(self, call: Callable[[], None]) -> None:
        """Begin a call in the thread."""
        self._calls.put(call)

    def is_usable(self) -> bool:
        """Whether the thread is here: it is not in a child that the process has forked."""
        return self._pid == os.getpid()

    def end(self) -> None:
        """Let the thread end after the call that it makes now, if any."""
        self._calls.put(None)

    def _work(self) -> None:
        for call in iter(self._calls.get, None):
            call()
            del call  # with what it holds: its result may be large
            if not self.is_usable():
                return  # the call has forked, and nobody in the child has another


class BackgroundCall:
    """One call, in a copy of the caller's context.

    Its result, or what it raised, counts until `leave_behind`. `on_late_end` is then called in the
    thread once the function has ended after all.
    """

    def __init__(
        self,
        function: Callable[[], object],
        name: str,
        on_late_end: Optional[Callable[[], None]] = None,
        kept: Optional[KeptThread] = None,
    ) -> None:
        """`kept`: the thread that makes the call. None means a new one of that name."""
        self.result: object = None
        self.error: Optional[BaseException] = None
        self.done = Flag()
        self.was_left_behind = False
        self._function = function
        self._on_late_end = on_late_end
        self._lock = threading.Lock()
        self._context = contextvars.copy_context()
        self._kept = kept
        self._thread = kept.thread if kept is not None else _thread(self._run, name)

    def start(self) -> None:
        """Begin the call in its thread."""
        if self._kept is None:
            self._thread.start()
        else:
            self._kept.begin(self._run)

    def _run(self) -> None:
        self._context.run(self._work)

    def leave_behind(self) -> bool:
        """Leave the thread to itself. Return False where it has ended after all."""
        with self._lock:
            self.was_left_behind = not self.done.is_set()
            return self.was_left_behind

    def returned(self) -> object:
        """Return what the function has returned, or raise what it has raised."""
        if self.error is not None:
            raise self.error
        return self.result

    def is_alive(self) -> bool:
        """Whether the thread lives."""
        return self._thread.is_alive()

    def _work(self) -> None:
        try:
            self.result = self._function()
        except BaseException as err:
            # handed to the caller's thread, SystemExit and KeyboardInterrupt among them
            self.error = err
        with self._lock:
            self.done.set()
            late = self.was_left_behind
        if late and self._on_late_end is not None:
            self._on_late_end()


def _thread(run: Callable[[], None], name: str) -> threading.Thread:
    return threading.Thread(target=run, name=name, daemon=True)
