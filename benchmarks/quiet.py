"""For benchmarks of what a machine costs or does: SMACH without its log, and limits."""

import itertools
import sys
import threading
from contextlib import contextmanager
from typing import Any, Callable, Iterator

# CPython 3.13 makes the bare loop faster (34 ns, 40 ns with 3.11), but not a machine's steps:
# the engine's ratio went from 10.9 to 12.5, that of a wrapped step from 12.0 to 15.0
SLOWER_BY = 1.25 if sys.version_info >= (3, 13) else 1.0


def in_bare_steps(limit: float) -> float:
    """Return a limit in steps of the bare loop, measured with CPython 3.11, for this Python."""
    return limit * SLOWER_BY


def silence() -> Any:
    """Give the smach that comes first on the path loggers that do nothing, and return it."""
    import smach

    def silent(*said: object) -> None:
        """A logger that nobody hears."""

    smach.set_loggers(silent, silent, silent, silent)
    return smach


@contextmanager
def counted_instructions() -> Iterator[Callable[[], int]]:
    """Count the instructions of Python that all threads execute in the body.

    It yields what returns their number so far. Each look counts as one more.
    """
    numbers = itertools.count()

    def trace(frame: Any, event: str, _arg: object) -> Any:
        if event == 'opcode':
            next(numbers)
        else:
            frame.f_trace_opcodes, frame.f_trace_lines = True, False
        return trace

    threading.settrace(trace)
    sys.settrace(trace)
    try:
        yield numbers.__next__
    finally:
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]  # which is how it is ended
