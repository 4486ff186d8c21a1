"""Reads a sound bag by its index: only the chunks that have what is wanted, and in these no more.

It is for speed. rosbags reads each index and each header of a bag, whatever is wanted of it. What
is seldom (lz4, no index) or not as it should be raises NotPlain, and is left to rosbags, which says
what is wrong. Format: ROS bag 2.0 (http://wiki.ros.org/Bags/Format/2.0).
"""

import bz2
import os
import struct
from contextlib import contextmanager
from types import TracebackType
from typing import Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple, Type

from smach_oracle.bag_format import (
    BAG_HEADER_END,
    COUNT_ENTRY,
    INDEX_ENTRY,
    MAGIC,
    OP_BAG_HEADER,
    OP_CHUNK,
    OP_CHUNK_INFO,
    OP_CONNECTION,
    OP_INDEX,
    OP_MESSAGE,
    STAMP,
    UINT32,
    UINT64,
    BagFormatError,
    Fields,
    parse_fields,
    uint32_field,
)

# parts of headers, as they stand in most files
_TIME_FIELD, _CONNECTION_FIELD = b'\x0d\x00\x00\x00time=', b'\x09\x00\x00\x00conn='
_IS_MESSAGE, _IS_INDEX = (
    b'\x04\x00\x00\x00op=' + bytes((kind,)) for kind in (OP_MESSAGE, OP_INDEX)
)
_LARGEST_CHUNK = 1 << 24  # bytes. Larger ones do not come into memory as a whole


class NotPlain(Exception):
    """The bag has something that is not read here."""


class PlainConnection(NamedTuple):
    """A topic, and the type of its messages."""

    order: int  # among those of the bag
    topic: str
    msgtype: str  # as rosbags writes it: PACKAGE/msg/NAME
    msgdef: str


class BagMessage(NamedTuple):
    """A message as it was recorded."""

    stamp: int  # ns
    connection: PlainConnection
    data: bytes


class _RawRecord(NamedTuple):
    fields: Fields
    start: int  # of its data, in the bytes that it was read from
    end: int


class _Chunk(NamedTuple):
    place: int
    counts: Mapping[int, int]  # of messages by connection


class IndexedBag:
    """A bag that is open for reading."""

    def __init__(self, path: str) -> None:
        """Read its index.

        :raises NotPlain: where rosbags is to read it.
        :raises OSError: where it cannot be opened.
        """
        self.connections: Dict[int, PlainConnection] = {}
        self._chunks: List[_Chunk] = []
        self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            with _plain():
                self._read_index()
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> 'IndexedBag':
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        os.close(self._file)

    def messages(self, *types: str) -> List[BagMessage]:
        """Return the messages of some types, in the order of their times.

        Those of one time are in the order of the connections, as rosbags has them.

        :raises NotPlain: where rosbags is to read them.
        """
        wanted = {
            number: each for number, each in self.connections.items() if each.msgtype in types
        }
        ends = [chunk.place for chunk in self._chunks[1:]] + [self._index_place]
        with _plain():
            found = [
                message
                for chunk, end in zip(self._chunks, ends)
                if not wanted.keys().isdisjoint(chunk.counts)
                for message in self._messages_in(chunk, end, wanted)
            ]
        return sorted(found, key=lambda message: (message.stamp, message.connection.order))

    def _part(self, start: int, end: int) -> bytes:
        data = os.pread(self._file, end - start, start)
        if len(data) < end - start:
            raise NotPlain('cut off')
        return data

    def _read_index(self) -> None:
        begin = os.pread(self._file, BAG_HEADER_END, 0)
        if not begin.startswith(MAGIC):
            raise NotPlain('no bag of version 2.0')
        fields = _record(begin, len(MAGIC), OP_BAG_HEADER).fields
        (self._index_place,) = UINT64.unpack(fields['index_pos'])
        tail = self._part(self._index_place, os.fstat(self._file).st_size)
        at = 0
        for _ in range(uint32_field(fields, 'conn_count')):
            record = _record(tail, at, OP_CONNECTION)
            number = uint32_field(record.fields, 'conn')
            about = parse_fields(tail[record.start : record.end])
            self.connections[number] = PlainConnection(
                len(self.connections),
                record.fields['topic'].decode(),
                about['type'].decode().replace('/', '/msg/'),
                about['message_definition'].decode(),
            )
            at = record.end
        for _ in range(uint32_field(fields, 'chunk_count')):
            record = _record(tail, at, OP_CHUNK_INFO)
            (place,) = UINT64.unpack(record.fields['chunk_pos'])
            counts = {
                conn: count
                for conn, count in COUNT_ENTRY.iter_unpack(tail[record.start : record.end])
            }
            self._chunks.append(_Chunk(place, counts))
            at = record.end
        self._chunks.sort()
        if at != len(tail) or not self._chunks:
            raise NotPlain('the index is not the end of it')

    def _messages_in(
        self, chunk: _Chunk, end: int, wanted: Mapping[int, PlainConnection]
    ) -> Iterator[BagMessage]:
        """Yield the messages of a chunk. Its index comes behind it, up to `end`."""
        if end - chunk.place > _LARGEST_CHUNK:
            raise NotPlain('a large chunk')
        whole = self._part(chunk.place, end)
        record = _record(whole, 0, OP_CHUNK)
        data = _opened(record, whole[record.start : record.end])
        left, at = dict(chunk.counts), record.end
        while at < len(whole):
            name, start, at = _index(whole, at)
            (number,) = UINT32.unpack(name[-4:])
            if left.pop(number, 0) * INDEX_ENTRY.size != at - start:
                raise NotPlain('an index has another length')
            if number in wanted:
                for second, rest, place in INDEX_ENTRY.iter_unpack(whole[start:at]):
                    message = _message(data, place, name, _TIME_FIELD + STAMP.pack(second, rest))
                    yield BagMessage(second * 10**9 + rest, wanted[number], message)
        if left:
            raise NotPlain('an index is missing')


@contextmanager
def _plain() -> Iterator[None]:
    """Raise NotPlain for whatever a file that is not sound makes the code inside raise."""
    try:
        yield
    except NotPlain:
        raise
    except (ArithmeticError, EOFError, LookupError, MemoryError, OSError, ValueError) as err:
        raise NotPlain(repr(err)) from err
    except (BagFormatError, struct.error) as err:
        raise NotPlain(str(err)) from err


def _record(data: bytes, at: int, kind: int) -> _RawRecord:
    """Return the record that begins at a place.

    :raises NotPlain: where it is of another kind, or cut off.
    """
    (length,) = UINT32.unpack_from(data, at)
    start = at + 4 + length
    fields = parse_fields(data[at + 4 : start])
    if fields['op'] != bytes([kind]):
        raise NotPlain('a record of another kind')
    (size,) = UINT32.unpack_from(data, start)
    if start + 4 + size > len(data):
        raise NotPlain('a record is cut off')
    return _RawRecord(fields, start + 4, start + 4 + size)


def _opened(record: _RawRecord, data: bytes) -> bytes:
    """Return the content of a chunk. It has the length that the chunk tells."""
    size = uint32_field(record.fields, 'size')
    if size > _LARGEST_CHUNK:
        raise NotPlain('a large chunk')
    compression = record.fields['compression']
    if compression == b'bz2':
        data = bz2.BZ2Decompressor().decompress(data, size + 1)
    elif compression != b'none':
        raise NotPlain('a compression that is seldom')
    if len(data) != size:
        raise NotPlain('a chunk has another length')
    return data


def _index(data: bytes, at: int) -> Tuple[bytes, int, int]:
    """Return the field that names the connection of an index record, and where its data is.

    Most records of a bag are such. Its fields are numbers, so no other value looks like a name.
    """
    (length,) = UINT32.unpack_from(data, at)
    start = at + 4 + length
    header = data[at + 4 : start]
    found = header.find(_CONNECTION_FIELD)
    (size,) = UINT32.unpack_from(data, start)
    name = header[found : found + len(_CONNECTION_FIELD) + UINT32.size]
    if found < 0 or _IS_INDEX not in header or start + 4 + size > len(data):
        raise NotPlain('no index behind a chunk')
    return name, start + 4, start + 4 + size


def _message(data: bytes, at: int, connection: bytes, time: bytes) -> bytes:
    """Return the data of the message whose record begins at a place of a chunk.

    :param connection: the field of its header that names it.
    :param time: the field that tells its time.
    """
    (length,) = UINT32.unpack_from(data, at)
    start = at + 4 + length
    header = data[at + 4 : start]
    (size,) = UINT32.unpack_from(data, start)
    message = data[start + 4 : start + 4 + size]
    sound = connection in header and time in header and _IS_MESSAGE in header
    if not sound or len(message) != size:
        raise NotPlain('an index leads to no message of its connection')
    return message
