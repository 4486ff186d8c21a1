"""The queue between the machine's threads and the recorder's writer thread."""

import threading
import time
from typing import Callable, List, NamedTuple, Optional, Tuple, Union

import genpy

from smach_oracle.bag_format import Stamp
from smach_oracle.oracle.records.events import Event

from .bag_writer import MessageType

LATE_POLL_S = 0.02
BACK_PRESSURE_POLL_S = 0.1  # how soon a blocked machine notices that the disk hangs


class Moment(NamedTuple):
    """The moment of an event or a message.

    Whether a bag uses ROS or wall time is decided once per bag.
    """

    ros: Optional[Stamp]  # None where there is no ROS time (yet)
    wall: float  # s since the epoch
    monotonic: float = 0.0  # s, how long it has waited for the disk


class EventItem(NamedTuple):
    """An event on its way to the bag of its trial."""

    event: Event
    when: Moment


class SnapshotItem(NamedTuple):
    """A message of this process that belongs to one trial (the learned rates)."""

    trial_id: str
    topic: str
    message: genpy.Message
    when: Moment


class EndItem(NamedTuple):
    """A trial that ended without TRIAL_END: the next one of the same machine has begun."""

    trial_id: str
    when: Moment


class MessageItem(NamedTuple):
    """A message of another topic, as it came.

    It goes to the bags of all trials that run, and of those that have just ended.
    """

    topic: str
    message_type: MessageType
    data: bytes
    when: Moment
    latching: bool
    callerid: str


_new_tuple = tuple.__new__


def new_moment(ros: Optional[Stamp], wall: float, monotonic: float) -> Moment:
    """Return a Moment, in half the time that its class takes: one is made for each event."""
    return _new_tuple(Moment, (ros, wall, monotonic))


def new_event_item(event: Event, when: Moment) -> EventItem:
    """Return an EventItem, likewise."""
    return _new_tuple(EventItem, (event, when))


QueueItem = Union[EventItem, SnapshotItem, EndItem, MessageItem]


class RecorderQueue:
    """Two bounds in one line: events wait for room, messages of other topics are turned away.

    One line, so that a message stays between the events between which it came. Memory: at most
    twice `max_events` events and `max_message_bytes` of messages (a batch being written, a batch
    waiting). The bound on events is also one on how long they wait, so an item that takes long to
    write, such as one that opens a file, weighs more than one.
    """

    def __init__(self, max_events: int, max_message_bytes: int) -> None:
        self._max_events = max_events
        self._max_message_bytes = max_message_bytes
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._items: List[QueueItem] = []
        self._weight = 0
        self._message_bytes = 0
        self._closing = False
        self._finished = False

    def put_event(self, item: QueueItem, may_wait: Callable[[], bool], weight: int = 1) -> bool:
        """Append an event or a snapshot, waiting for room for as long as `may_wait()`.

        :returns: whether it was appended.
        """
        with self._lock:  # as `with self._changed`, without its two calls
            while self._weight >= self._max_events and not self._closing:
                if not may_wait():
                    return False
                self._changed.wait(BACK_PRESSURE_POLL_S)
            if self._closing:
                return False
            self._weight += weight
            self._items.append(item)
            if len(self._items) == 1:
                self._changed.notify_all()
            return True

    def put_message(self, item: MessageItem) -> bool:
        """Append a message of another topic. Return whether there was room."""
        with self._changed:
            if self._closing or self._message_bytes + len(item.data) > self._max_message_bytes:
                return False
            self._message_bytes += len(item.data)
            self._items.append(item)
            if len(self._items) == 1:
                self._changed.notify_all()
            return True

    def take(self, timeout_s: Optional[float]) -> Tuple[List[QueueItem], bool]:
        """Return all that waits, in order, and whether the queue is closing.

        :param timeout_s: how long to wait where it is empty. None means without end.
        """
        with self._changed:
            if not self._items and not self._closing:
                self._changed.wait(timeout_s)
            items, self._items = self._items, []
            self._weight = self._message_bytes = 0
            self._changed.notify_all()
            return items, self._closing

    def wait_while(self, condition: Callable[[], bool], timeout_s: float) -> None:
        """Let items in and out for as long as a condition holds, but no longer than `timeout_s`.

        As in `close`, the lock is let go of meanwhile.
        """
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while condition() and not self._closing and time.monotonic() < deadline:
                self._changed.wait(LATE_POLL_S)

    def close(self, timeout_s: float) -> bool:
        """Let nothing more in and wait until the writer has finished with what is in.

        Often called by a signal handler that struck while its own thread was in here: waiting on
        the condition lets go of the lock however often that thread holds it, where joining the
        writer would keep it from the writer.

        :returns: whether the writer has finished.
        """
        deadline = time.monotonic() + timeout_s
        with self._changed:
            self._closing = True
            self._changed.notify_all()
            while not self._finished and time.monotonic() < deadline:
                self._changed.wait(max(0.0, deadline - time.monotonic()))
            return self._finished

    def finish(self) -> None:
        """Note that the writer has finished."""
        with self._changed:
            self._finished = True
            self._changed.notify_all()
