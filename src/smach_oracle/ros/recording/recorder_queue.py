"""What stands between the machine's threads and the recorder's writer thread."""
import threading
import time
from typing import Any, Callable, List, NamedTuple, Optional, Tuple

from ..oracle.events import Event
from .bag_format import Stamp
from .bag_writer import MessageType

BACK_PRESSURE_POLL_S = 0.1  # how soon a blocked machine notices that the disk hangs


class When(NamedTuple):
    """The moment of an event or a message; whether a bag uses ROS or wall time is decided once per bag."""

    ros: Optional[Stamp]  # None where there is no ROS time (yet)
    wall: float  # s since the epoch
    monotonic: float = 0.0  # s; how long it has waited for the disk


class EventItem(NamedTuple):
    """An event on its way to the bag of its trial."""

    event: Event
    when: When


class SnapshotItem(NamedTuple):
    """A message of this process that belongs to one trial (the learned rates)."""

    trial_id: str
    topic: str
    message: Any  # genpy.Message
    when: When


class EndItem(NamedTuple):
    """A trial that ended without TRIAL_END: the next one of the same machine has begun."""

    trial_id: str
    when: When


class MessageItem(NamedTuple):
    """A message of another topic, as it came; it goes to the bags of all trials that run."""

    topic: str
    message_type: MessageType
    data: bytes
    when: When
    latching: bool
    callerid: str


class RecorderQueue:
    """Two bounds in one line: events wait for room, messages of other topics are turned away.

    One line, so that a message stays between the events between which it came. Memory: at most twice `max_events`
    events and `max_message_bytes` of messages (a batch being written, a batch waiting). The bound on events is also one
    on how long they wait, so an item that takes long to write, such as one that opens a file, weighs more than one.
    """

    def __init__(self, max_events: int, max_message_bytes: int) -> None:
        self._max_events = max_events
        self._max_message_bytes = max_message_bytes
        self._changed = threading.Condition(threading.RLock())
        self._items: List[Any] = []
        self._weight = 0
        self._message_bytes = 0
        self._closing = False
        self._finished = False

    def put_event(self, item: Any, may_wait: Callable[[], bool], weight: int = 1) -> bool:
        """Append an event or a snapshot, waiting for room for as long as `may_wait()`; whether it was appended."""
        with self._changed:
            while self._weight >= self._max_events and not self._closing:
                if not may_wait():
                    return False
                self._changed.wait(BACK_PRESSURE_POLL_S)
            if self._closing:
                return False
            self._weight += weight
            self._append(item)
            return True

    def put_message(self, item: MessageItem) -> bool:
        """Append a message of another topic; whether there was room."""
        with self._changed:
            if self._closing or self._message_bytes + len(item.data) > self._max_message_bytes:
                return False
            self._message_bytes += len(item.data)
            self._append(item)
            return True

    def _append(self, item: Any) -> None:
        self._items.append(item)
        if len(self._items) == 1:
            self._changed.notify_all()

    def take(self, timeout_s: Optional[float]) -> Tuple[List[Any], bool]:
        """All that waits, in order, after at most `timeout_s` (None: without end), and whether it is closing."""
        with self._changed:
            if not self._items and not self._closing:
                self._changed.wait(timeout_s)
            items, self._items = self._items, []
            self._weight = self._message_bytes = 0
            self._changed.notify_all()
            return items, self._closing

    def close(self, timeout_s: float) -> bool:
        """Let nothing more in and wait until the writer has finished with what is in; whether it has.

        Often called by a signal handler that struck while its own thread was in here: waiting on the condition lets go
        of the lock however often that thread holds it, where joining the writer would keep it from the writer.
        """
        deadline = time.monotonic() + timeout_s
        with self._changed:
            self._closing = True
            self._changed.notify_all()
            while not self._finished and time.monotonic() < deadline:
                self._changed.wait(max(0.0, deadline - time.monotonic()))
            return self._finished

    def finish(self) -> None:
        """The writer's last word."""
        with self._changed:
            self._finished = True
            self._changed.notify_all()
