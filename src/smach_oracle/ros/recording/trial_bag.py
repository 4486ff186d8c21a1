"""The bag of one trial while it is being written."""

import os
import re
import time
from typing import Callable, Dict, Optional

import genpy

from smach_oracle.bag_format import Stamp
from smach_oracle.oracle.records.events import Event

from .bag_repair import ACTIVE_SUFFIX, free_name
from .bag_writer import MAX_CHUNK_BYTES, BagWriter, MessageType
from .event_packing import EVENT_TYPE, pack_event, serialise
from .recorder_queue import MessageItem, Moment
from .recorder_status import DiskWatch

FLUSH_AFTER_S = 0.2  # what a crash of this process may cost, at most, while the disk works
SYNC_AFTER_S = 1.0  # what a power cut may cost, on a disk that can keep up
SYNC_SHARE = 0.1  # of the writer's time, at most: the rest is for events that wait
_LONGEST_ID = 80


class SyncBudget:
    """Limits the share of time spent waiting for the disk (fsync).

    That matters on slow disks and with short trials.
    """

    def __init__(self, share: float = SYNC_SHARE) -> None:
        self._share = share
        self._next = 0.0

    def affordable(self) -> bool:
        """Whether it is time for another one."""
        return time.monotonic() >= self._next

    def spend(self, sync: Callable[[], None]) -> None:
        """Sync, and note how long it took."""
        began = time.monotonic()
        sync()
        ended = time.monotonic()
        self._next = ended + (ended - began) * (1 - self._share) / self._share


class TrialBag:
    """One trial's file.

    Named `<UTC stamp>_<trial id>.bag.active` until it is closed, then without `.active`.

    :raises OSError: in all methods, where the disk does not take it.
    """

    def __init__(
        self, folder: str, trial_id: str, when: Moment, watch: DiskWatch, budget: SyncBudget
    ) -> None:
        self.trial_id = trial_id
        self.events_written = 0
        self.over: Optional[Moment] = None  # when its trial ended
        self._events_in_chunk = 0
        self._events_unsynced = 0
        self._events_at_risk = 0  # events that are lost if the next call to the disk fails
        self._watch = watch
        self._budget = budget
        self._uses_ros_time = when.ros is not None
        self._last_stamp: Stamp = when.ros or wall_stamp(when.wall)
        self._chunk_since: Optional[float] = None
        # the first events at once: even a trial killed early leaves a trace
        self._flush_after_s = 0.0
        self._synced = time.monotonic()
        with watch:
            self.path = free_name(os.path.join(folder, file_name(trial_id, when.wall)))
            self._writer = BagWriter(self.path + '.active')

    def stamp(self, when: Moment) -> Stamp:
        """Return the moment by this bag's clock.

        ROS time where there was one at its beginning, else wall time.
        """
        if not self._uses_ros_time:
            self._last_stamp = wall_stamp(when.wall)
        elif when.ros is not None:
            self._last_stamp = when.ros
        return self._last_stamp

    def add_event(self, topic: str, event: Event, when: Moment) -> None:
        """Add an event."""
        data = pack_event(event, when.ros or (0, 0))
        self.events_written += 1
        self._events_in_chunk += 1  # before the chunk may be flushed: it is lost with it
        self._add(topic, EVENT_TYPE, data, when, None)

    def add_message(
        self, topic: str, message: genpy.Message, when: Moment, latching: bool = False
    ) -> None:
        """Add another message (genpy.Message) of this process."""
        kind = MessageType(message._type, message._md5sum, message._full_text)  # genpy's own names
        self._add(topic, kind, serialise(message), when, {'latching': '1'} if latching else {})

    def add_raw(self, item: MessageItem) -> None:
        """Add a message of another topic as it came."""
        details = {'callerid': item.callerid} if item.callerid else {}
        if item.latching:
            details['latching'] = '1'
        self._add(item.topic, item.message_type, item.data, item.when, details)

    def _add(
        self,
        topic: str,
        kind: MessageType,
        data: bytes,
        when: Moment,
        details: Optional[Dict[str, str]],
    ) -> None:
        buffered_bytes = self._writer.add(topic, kind, self.stamp(when), data, details)
        if self._chunk_since is None:
            self._chunk_since = when.monotonic
        if buffered_bytes >= MAX_CHUNK_BYTES:
            self.flush()

    def due_s(self) -> Optional[float]:
        """Return the seconds until `flush` is due, or None while there is nothing to flush."""
        if self._chunk_since is None:
            return None
        return max(0.0, self._chunk_since + self._flush_after_s - time.monotonic())

    def flush(self) -> None:
        """Hand what there is to the operating system, and once a second to the disk."""
        with self._watch:
            self._flush()
            if time.monotonic() - self._synced >= SYNC_AFTER_S and self._budget.affordable():
                self._events_at_risk = self._events_unsynced
                self._budget.spend(self._writer.sync)
                os.stat(self.path + '.active')  # a removed file takes everything and keeps nothing
                self._events_unsynced = self._events_at_risk = 0
                self._synced = time.monotonic()

    def _flush(self) -> None:
        self._events_at_risk = self._events_in_chunk
        self._writer.flush()
        self._events_unsynced += self._events_in_chunk
        self._events_in_chunk = self._events_at_risk = 0
        self._chunk_since = None
        self._flush_after_s = FLUSH_AFTER_S

    def close(self) -> None:
        """Write the index and give the file its final name."""
        with self._watch:
            self._flush()
            if self._budget.affordable():
                self._budget.spend(self._writer.close)
            else:
                self._writer.close(sync=False)
            os.rename(self.path + '.active', self.path)

    def abandon(self) -> int:
        """Leave the file after an error.

        What reached the disk stays there, to be indexed when the disk works again.

        :returns: how many of the events written into it are lost.
        """
        with self._watch:
            self._writer.abandon()
            try:
                if self._writer.has_chunks:
                    os.stat(self.path + '.active')
                    return max(self._events_at_risk, self._events_in_chunk)
                os.unlink(self.path + '.active')
            except OSError:
                pass  # the file has vanished, and what was in it
            return self.events_written


def wall_stamp(wall_time: float) -> Stamp:
    """Return seconds since the epoch as seconds and nanoseconds."""
    return divmod(round(wall_time * 1e9), 10**9)


def file_name(trial_id: str, wall_time: float) -> str:
    """Make a file name such as 20150401T101112.345Z_pick_1.bag.

    Characters that a file name should not contain become underscores.
    """
    seconds, nanoseconds = wall_stamp(wall_time)
    stamp = time.strftime('%Y%m%dT%H%M%S', time.gmtime(seconds)) + '.{:03d}Z'.format(
        nanoseconds // 10**6
    )
    clean = re.sub(r'[^A-Za-z0-9._-]', '_', trial_id)[:_LONGEST_ID] or 'trial'
    return '{}_{}{}'.format(stamp, clean, ACTIVE_SUFFIX[: -len('.active')])


def ros_stamp_of(seconds: int, nanoseconds: int) -> Optional[Stamp]:
    """Return a ROS time as a stamp, or None for zero.

    A simulated clock shows zero before it runs.
    """
    return (seconds, nanoseconds) if seconds or nanoseconds else None
