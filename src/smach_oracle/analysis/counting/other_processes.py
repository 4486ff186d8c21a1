"""Processes that count bags with this one."""

import os
import pickle
import select
import signal
import struct
from array import array
from collections import deque
from contextlib import suppress
from typing import Any, Callable, Deque, List, NamedTuple, Optional, Sequence

from ..bag_events import EventReader
from .counted_bag import BeginCount, CountedBag, Counting, count_bag
from .summary_text import SummaryText, shared_by, summaries_in_all, text_of

_GIVEN_AHEAD = 2  # groups for each process: it has the next one when it is done with one
_LENGTH = struct.Struct('<Q')
_NUMBERS = 'I'  # of bags, in what is sent
_READ_AT_ONCE = 1 << 20  # bytes

_Received = List['_SentBag']


class _SentBag(NamedTuple):
    """A counted bag without its path. It has one text for its summaries, which is quick to read."""

    text: Optional[SummaryText]  # None: there is a reason
    taken: Sequence[Any]
    reason: str


class _BagGroup:
    """Some bags that are to be counted."""

    def __init__(self, paths: Sequence[str], count_here: Callable[[], List[CountedBag]]) -> None:
        self.paths = paths
        self.count_here = count_here
        self.counted: Optional[List[CountedBag]] = None


class OtherProcesses:
    """Some processes that count bags next to this one.

    Should one of them die, the others count what it leaves. They are forked, so that they have all
    modules at once: this process must have no other thread.
    """

    def __init__(
        self, counting: Counting, paths: Sequence[str], count_here: BeginCount, number: int
    ) -> None:
        """
        :param paths: of all bags that there are.
        :param count_here: counts in this process, once it is waited for.
        :param number: of other processes. Where the system allows fewer, there are fewer.
        """
        self._count_here = count_here
        self._numbers = {path: number for number, path in enumerate(paths)}
        self._left: Deque[_BagGroup] = deque()  # that no process has
        self._processes: List[_Process] = []
        with suppress(OSError):
            for _ in range(number):
                self._processes.append(_Process(counting, paths, self._processes))

    def begin(self, paths: Sequence[str]) -> Callable[[], List[CountedBag]]:
        """Begin to count some bags."""
        group = _BagGroup(paths, self._count_here(paths))
        self._left.append(group)
        self._give()
        return lambda: self._wait_for(group)

    def close(self) -> None:
        """End the processes."""
        for process in self._processes:
            process.close()

    def _give(self) -> None:
        """Give each process enough to do."""
        for process in list(self._processes):
            while self._left and len(process.given) < _GIVEN_AHEAD:
                group = self._left.popleft()
                try:
                    process.give(group, [self._numbers[path] for path in group.paths])
                except OSError:
                    self._left.appendleft(group)
                    self._lose(process)
                    break

    def _wait_for(self, group: _BagGroup) -> List[CountedBag]:
        while group.counted is None:
            self._receive(wait=not self._left)
            self._give()
            if group.counted is None and self._left:
                here = self._left.popleft()
                here.counted = here.count_here()
        return group.counted

    def _receive(self, wait: bool) -> None:
        """Take what processes have counted."""
        by_file = {process.results: process for process in self._processes}
        ready = select.poll()
        for file in by_file:
            ready.register(file, select.POLLIN)
        for file, _ in ready.poll(None if wait and by_file else 0):
            try:
                by_file[file].take()
            except (EOFError, OSError):
                self._lose(by_file[file])

    def _lose(self, process: '_Process') -> None:
        """Do without a process that has died."""
        self._processes.remove(process)
        self._left.extendleft(reversed(process.given))
        process.close()


class _Process:
    """One process. It gets numbers of bags, and sends the counts of these."""

    def __init__(
        self, counting: Counting, paths: Sequence[str], before: Sequence['_Process']
    ) -> None:
        """:raises OSError: where the system allows no more processes."""
        self.given: Deque[_BagGroup] = deque()
        numbers, self._numbers = os.pipe()
        self.results, results = os.pipe()
        self._pid: Optional[int] = None
        # Ctrl-C goes to all processes of a terminal. A child ignores it, since the parent ends the
        # child. Until then the signal is blocked
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            self._pid = os.fork()
            if not self._pid:
                try:
                    signal.signal(signal.SIGINT, signal.SIG_IGN)
                    signal.pthread_sigmask(signal.SIG_SETMASK, mask)
                    for process in [*before, self]:  # they are the parent's
                        process._close_files()
                    _count_all(numbers, results, counting, paths)
                finally:
                    os._exit(0)  # whatever happens: all else is the parent's
        except OSError:
            self._close_files()
            raise
        finally:
            os.close(numbers)
            os.close(results)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    def give(self, group: _BagGroup, numbers: Sequence[int]) -> None:
        """:raises OSError: where the process has died."""
        _send(self._numbers, array(_NUMBERS, numbers).tobytes())
        self.given.append(group)

    def take(self) -> None:
        """Take the counts of the group that it got first.

        :raises EOFError, OSError: where the process has died.
        """
        received: _Received = pickle.loads(_receive(self.results))  # noqa: S301 - of its own child
        group = self.given.popleft()
        group.counted = list(_read(group.paths, received))

    def close(self) -> None:
        """End it. It writes nothing that a sudden end could spoil."""
        self._close_files()
        if self._pid:
            with suppress(ProcessLookupError, ChildProcessError):
                os.kill(self._pid, signal.SIGKILL)
                os.waitpid(self._pid, 0)
            self._pid = None

    def _close_files(self) -> None:
        for file in (self._numbers, self.results):
            with suppress(OSError):
                os.close(file)


def _read(paths: Sequence[str], received: _Received) -> List[CountedBag]:
    texts = {path: sent.text for path, sent in zip(paths, received) if sent.text}
    shared = dict(part for text in texts.values() for part in text.shared)
    summaries = summaries_in_all(
        {path: text.text for path, text in texts.items()}, shared_by(shared.__getitem__)
    )
    return [
        CountedBag(
            path,
            list(zip(summaries[path] if sent.text else (), sent.taken)),
            sent.reason,
            sent.text,
        )
        for path, sent in zip(paths, received)
    ]


def _count_all(numbers: int, results: int, counting: Counting, paths: Sequence[str]) -> None:
    """Count the bags whose numbers come, until there are no more."""
    reader = EventReader()
    with suppress(EOFError, OSError):  # the parent is done, or gone
        while True:
            group = array(_NUMBERS)
            group.frombytes(_receive(numbers))
            found = [count_bag(paths[number], reader, counting) for number in group]
            _send(results, pickle.dumps([_sent(bag) for bag in found], pickle.HIGHEST_PROTOCOL))


def _sent(bag: CountedBag) -> _SentBag:
    summaries = [summary for summary, _ in bag.trials]
    text = None if bag.reason else text_of(summaries)
    return _SentBag(text, [taken for _, taken in bag.trials], bag.reason)


def _send(file: int, data: bytes) -> None:
    left = memoryview(_LENGTH.pack(len(data)) + data)
    while left:
        left = left[os.write(file, left) :]


def _receive(file: int) -> bytes:
    """:raises EOFError: where there is no more."""
    (length,) = _LENGTH.unpack(_exactly(file, _LENGTH.size))
    return _exactly(file, length)


def _exactly(file: int, size: int) -> bytes:
    parts: List[bytes] = []
    while size:
        part = os.read(file, min(size, _READ_AT_ONCE))
        if not part:
            raise EOFError
        parts.append(part)
        size -= len(part)
    return b''.join(parts)
