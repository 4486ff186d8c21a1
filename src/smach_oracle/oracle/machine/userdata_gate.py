"""Userdata seen through a gate: recorded while the oracle recovers, shut when a state is abandoned.

The gate sits where a `smach.UserData` keeps its dictionary (`_data`), so that every way of writing
passes it: by attribute, by item, by `update`, through a Remapper, from the output keys of a nested
container.
"""

import threading
from collections.abc import MutableMapping
from typing import Any, Callable, Iterator, Optional, Set

import smach

from .protocols import Machine


class UserdataGate(MutableMapping):
    """The dictionary of a container's userdata, with a record of the keys written.

    It looks the dictionary up again each time.

    After `shut` writes are dropped, and told to `on_late_write(key)`. Safe to use from several
    threads.
    """

    def __init__(
        self, machine: Machine, on_late_write: Optional[Callable[[str], None]] = None
    ) -> None:
        self._machine = machine
        self._on_late_write = on_late_write
        self._lock = threading.Lock()
        self._open = True
        self.written: Set[str] = set()

    def branch(self) -> 'UserdataGate':
        """Return a gate that can be shut alone and records into the same set."""
        other = UserdataGate(self._machine, self._on_late_write)
        other.written = self.written
        return other

    def shut(self) -> None:
        """Let no write pass from now on."""
        with self._lock:
            self._open = False

    def __getitem__(self, key: str) -> object:
        return self._machine.userdata._data[key]

    def __setitem__(self, key: str, value: object) -> None:
        with self._lock:
            if self._open:
                self.written.add(key)
                self._machine.userdata._data[key] = value
                return
        self._late(key)

    def __delitem__(self, key: str) -> None:
        with self._lock:
            if self._open:
                self.written.add(key)
                del self._machine.userdata._data[key]
                return
        self._late(key)

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._machine.userdata._data))

    def __len__(self) -> int:
        return len(self._machine.userdata._data)

    def _late(self, key: str) -> None:
        if self._on_late_write is not None:
            self._on_late_write(key)


def behind(gate: UserdataGate) -> smach.UserData:
    """Return a `smach.UserData` whose reads and writes pass `gate`."""
    userdata: Any = smach.UserData()
    userdata._data = gate
    return userdata
