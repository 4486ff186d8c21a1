"""Writes a new bag of what can be read of a damaged one, and reads it back.

The damaged one stays.
"""

import os
import zlib
from typing import BinaryIO, Callable, Dict, List, NamedTuple, Optional

from smach_oracle import bag_format
from smach_oracle.bag_format import BagFormatError, Stamp

from .bag_contents import BagConnection, Connections, is_readable
from .bag_salvage import Found, Salvage
from .bag_writer import MAX_CHUNK_BYTES, BagWriter
from .event_packing import event_number

_NANOSECONDS = 10**9


class Saved(NamedTuple):
    """The counts of a mended bag: what it holds, and what is lost."""

    messages: int
    checksum: int  # of all topics, stamps and messages
    bytes_lost: int
    chunks_lost: int  # at least: a gap may span several
    events_lost: int  # by the sequence numbers of those around a gap
    torn_bytes: int  # at the end, where the writer died

    def losses(self) -> str:
        """Return what is lost, in words, or '' where nothing is."""
        parts = []
        if self.bytes_lost:
            parts.append(
                '{} bytes in at least {} chunk{}, among them {} event{}'.format(
                    self.bytes_lost,
                    self.chunks_lost,
                    's' * (self.chunks_lost != 1),
                    self.events_lost,
                    's' * (self.events_lost != 1),
                )
            )
        if self.torn_bytes:
            parts.append('the last {} bytes, which were torn'.format(self.torn_bytes))
        return ' and '.join(parts)


def mend(source: BinaryIO, target: str) -> Saved:
    """Write what can be read of a bag into a new file.

    :param source: the damaged bag. It is only read.
    :param target: path of the new bag. A file that is there is replaced.
    :raises OSError: where the disk cannot be read or takes no more. There is no new file then.
    """
    return _in_two_passes(source, lambda reading: reading.write(target))


def read_back(path: str, saved: Saved) -> None:
    """Check that a mended bag is sound and holds what was saved.

    :raises OSError: where it does not, or the disk cannot be read.
    """
    with open(path, 'rb') as bag:
        found = contents(bag)
        if found.losses() or found[:2] != saved[:2]:
            raise OSError(
                '{} does not hold what was written: {} messages of {}{}'.format(
                    path,
                    found.messages,
                    saved.messages,
                    found.losses() and ', lost: ' + found.losses(),
                )
            )
        try:
            _check_index(bag, saved.messages)
        except BagFormatError as err:
            raise OSError('the index of {} is wrong: {}'.format(path, err)) from err


def contents(bag: BinaryIO) -> Saved:
    """Return what `mend` would save of a bag.

    :raises OSError: where the disk cannot be read.
    """
    return _in_two_passes(bag, lambda reading: reading.read())


def _in_two_passes(source: BinaryIO, work: Callable[['_Pass'], Saved]) -> Saved:
    """Do it again where the end of the file has told more of the connections than its beginning."""
    first = _Pass(source, {})
    saved = work(first)
    known = first.connections.all()
    if all(known.get(number) == used for number, used in first.used.items()):
        return saved
    return work(_Pass(source, known))


class _Pass:
    """One reading of a damaged bag from its beginning to its end."""

    def __init__(self, source: BinaryIO, known: Dict[int, BagConnection]) -> None:
        self.connections = Connections()
        self.used: Dict[int, Optional[BagConnection]] = {}  # None: some messages had none
        self._known = known
        self._salvage = Salvage(source)
        self._messages = self._checksum = self._events_lost = 0
        self._next_event = 0
        self._lost_before_event = 0

    def write(self, target: str) -> Saved:
        """Save the messages into a new bag."""
        if os.path.exists(target):
            os.unlink(target)
        writer = BagWriter(target)
        try:
            saved = self.read(writer)
            writer.close()
        except OSError:
            writer.abandon()
            os.unlink(target)
            raise
        return saved

    def read(self, writer: Optional[BagWriter] = None) -> Saved:
        """Count the messages, and hand them to a writer."""
        for found in self._salvage.read():
            if found.record.op == bag_format.OP_CONNECTION:
                if not self.connections.learn(found.record.fields, found.data):
                    self._salvage.lose(found.record.end - found.record.position)
            else:
                self._take(found, writer)
        return Saved(
            self._messages,
            self._checksum,
            self._salvage.bytes_lost,
            self._salvage.places_lost,
            self._events_lost,
            self._salvage.torn_bytes,
        )

    def _take(self, found: Found, writer: Optional[BagWriter]) -> None:
        number = bag_format.uint32_field(found.record.fields, 'conn')
        stamp = bag_format.stamp_at(found.record.fields['time'], 0)
        connection = self._known.get(number) or self.connections.of(number)
        if self.used.setdefault(number, connection) != connection:
            self.used[number] = None
        if connection is None:
            self.connections.add_orphan(number, found.data)
        if (
            connection is None
            or stamp[1] >= _NANOSECONDS
            or not self._is_readable(connection, found)
        ):
            self._salvage.lose(found.record.end - found.record.position)
        else:
            self._save(connection, stamp, found.data, writer)

    def _is_readable(self, connection: BagConnection, found: Found) -> bool:
        if not connection.has_events:
            return is_readable(connection.kind, found.data, found.is_sure)
        number = event_number(found.data)
        if number is not None:
            self._count_lost_events(number)
        return number is not None

    def _save(
        self, connection: BagConnection, stamp: Stamp, data: bytes, writer: Optional[BagWriter]
    ) -> None:
        self._messages += 1
        head = connection.topic.encode() + bag_format.STAMP.pack(*stamp)
        self._checksum = (self._checksum + zlib.crc32(data, zlib.crc32(head))) % (1 << 64)
        if writer is not None:
            buffered_bytes = writer.add(
                connection.topic, connection.kind, stamp, data, dict(connection.details)
            )
            if buffered_bytes >= MAX_CHUNK_BYTES:
                writer.flush()

    def _count_lost_events(self, number: int) -> None:
        """Count the numbers left out behind the event before, where anything was lost there."""
        if self._salvage.bytes_lost > self._lost_before_event:
            self._events_lost += max(0, number - self._next_event)
        self._lost_before_event = self._salvage.bytes_lost
        self._next_event = number + 1


def _check_index(bag: BinaryIO, messages: int) -> None:
    """Check that the index leads to every message.

    :raises BagFormatError: where it does not.
    """
    bag.seek(len(bag_format.MAGIC))
    fields = bag_format.read_header(bag, bag_format.HEADER_RECORD_SIZE)
    bag.seek(bag_format.UINT64.unpack(fields['index_pos'])[0])
    for _ in range(bag_format.uint32_field(fields, 'conn_count')):
        _next_record(bag, bag_format.OP_CONNECTION)
    chunks = [
        _next_record(bag, bag_format.OP_CHUNK_INFO)
        for _ in range(bag_format.uint32_field(fields, 'chunk_count'))
    ]
    indexed = 0
    for chunk in chunks:
        bag.seek(bag_format.UINT64.unpack(chunk['chunk_pos'])[0])
        _next_record(bag, bag_format.OP_CHUNK)
        counts: List[int] = [
            bag_format.uint32_field(_next_record(bag, bag_format.OP_INDEX), 'count')
            for _ in range(bag_format.uint32_field(chunk, 'count'))
        ]
        indexed += sum(counts)
    if indexed != messages:
        raise BagFormatError('it leads to {} messages of {}'.format(indexed, messages))


def _next_record(bag: BinaryIO, op: int) -> bag_format.Fields:
    fields = bag_format.read_header(bag, MAX_CHUNK_BYTES)
    if bag_format.op_of(fields) != op:
        raise BagFormatError('a record of op {} is missing'.format(op))
    bag.seek(bag_format.UINT32.unpack(bag_format.read_exactly(bag, 4))[0], os.SEEK_CUR)
    return fields
