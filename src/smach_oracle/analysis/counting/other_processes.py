"""Processes that count bags for this one."""

import signal
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Callable, List, Optional, Sequence

from ..bag_events import EventReader
from .counted_bag import BeginCount, CountedBag, Counting, count_bag

_readers: List[EventReader] = []  # of a process that counts for another one


class OtherProcesses:
    """Some processes. Should one of them die, what is left is counted by this one."""

    def __init__(self, counting: Counting, count_here: BeginCount) -> None:
        """`count_here`: counts in this process, once it is waited for."""
        self._counting = counting
        self._count_here = count_here
        # a fork has all modules at once. At this time the process has no other thread
        self._pool: Optional[ProcessPoolExecutor] = ProcessPoolExecutor(
            counting.processes, get_context('fork'), _leave_interrupt_to_parent
        )

    def begin(self, paths: Sequence[str]) -> Callable[[], List[CountedBag]]:
        """Begin to count some bags."""
        here = self._count_here(paths)
        if self._pool is None:
            return here
        try:
            future = self._pool.submit(_count_group, paths, self._counting)
        except BrokenProcessPool:
            self._pool = None
            return here

        def counted() -> List[CountedBag]:
            try:
                return future.result()
            except BrokenProcessPool:
                self._pool = None
                return here()

        return counted

    def close(self) -> None:
        """End the processes. It waits for what they have begun."""
        if self._pool is not None:
            self._pool.shutdown()


def _leave_interrupt_to_parent() -> None:
    """Ignore Ctrl-C, which goes to all processes of a terminal. The parent ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _count_group(paths: Sequence[str], counting: Counting) -> List[CountedBag]:
    if not _readers:
        _readers.append(EventReader())
    return [count_bag(path, _readers[0], counting) for path in paths]
