"""Calls a function in a thread of its own, so that nobody has to wait for its end."""

import contextvars
import threading
from typing import Callable, Optional


class BackgroundCall:
    """One call, in a copy of the caller's context.

    Its result, or what it raised, counts until `leave`. `on_late_end` is then called in the thread
    once the function has ended after all.
    """

    def __init__(
        self,
        function: Callable[[], object],
        name: str,
        on_late_end: Optional[Callable[[], None]] = None,
    ) -> None:
        self.result: object = None
        self.error: Optional[BaseException] = None
        self.done = threading.Event()
        self.left = False
        self._function = function
        self._on_late_end = on_late_end
        self._lock = threading.Lock()
        self._thread = threading.Thread(
            target=contextvars.copy_context().run, args=(self._work,), name=name, daemon=True
        )

    def start(self) -> None:
        """Begin the call in its thread."""
        self._thread.start()

    def leave(self) -> bool:
        """Leave the thread to itself. Return False where it has ended after all."""
        with self._lock:
            self.left = not self.done.is_set()
            return self.left

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
            late = self.left
        if late and self._on_late_end is not None:
            self._on_late_end()
