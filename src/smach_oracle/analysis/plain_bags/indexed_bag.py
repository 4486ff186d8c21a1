"""Reads a sound bag by its index: only the chunks that have what is wanted, and in these no more.

It is for speed. rosbags reads each index and each header of a bag, whatever is wanted of it. What
is seldom (lz4, no index) or not as it should be raises NotPlain, and is left to rosbags, which says
what is wrong. Format: ROS bag 2.0 (http://wiki.ros.org/Bags/Format/2.0).
"""

import bz2
import os
import struct
from contextlib import contextmanager
from functools import partial
from types import TracebackType
from typing import Callable, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple, Type

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
_PLACE_FIELD, _SIZE_FIELD = b'\x12\x00\x00\x00chunk_pos=', b'\x09\x00\x00\x00size='
_NOT_COMPRESSED = b'\x10\x00\x00\x00compression=none'
_IS_MESSAGE, _IS_INDEX, _IS_CHUNK, _IS_CHUNK_INFO = (
    b'\x04\x00\x00\x00op=' + bytes((kind,))
    for kind in (OP_MESSAGE, OP_INDEX, OP_CHUNK, OP_CHUNK_INFO)
)
_AT_ONCE, _PIECE = 1 << 16, 1 << 12  # bytes. Larger chunks are read by pieces
_LARGEST_CHUNK = 1 << 24  # bytes. Larger ones do not come into memory as a whole


class NotPlain(Exception):
    """The bag has something that is not read here."""


class PlainConnection(NamedTuple):
    """A topic, and the type of its messages."""

    order: int  # among those of the bag
    topic: str
    msgtype: str  # as rosbags writes it: PACKAGE/msg/NAME
    msgdef: str
    md5sum: str  # of the definition, in hexadecimal digits


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
                about['md5sum'].decode(),
            )
            at = record.end
        for _ in range(uint32_field(fields, 'chunk_count')):
            place_field, start, at = _found(tail, at, _IS_CHUNK_INFO, _PLACE_FIELD, UINT64.size)
            (place,) = UINT64.unpack(place_field[-UINT64.size :])
            counts = {conn: count for conn, count in COUNT_ENTRY.iter_unpack(tail[start:at])}
            self._chunks.append(_Chunk(place, counts))
        self._chunks.sort()
        if at != len(tail) or not self._chunks:
            raise NotPlain('the index is not the end of it')

    def _messages_in(
        self, chunk: _Chunk, end: int, wanted: Mapping[int, PlainConnection]
    ) -> Iterator[BagMessage]:
        """Yield the messages of a chunk. Its index comes behind it, up to `end`."""
        record_at, index = self._opened_chunk(chunk.place, end)
        left, at = dict(chunk.counts), 0
        while at < len(index):
            name, start, at = _found(index, at, _IS_INDEX, _CONNECTION_FIELD, UINT32.size)
            (number,) = UINT32.unpack(name[-UINT32.size :])
            if left.pop(number, 0) * INDEX_ENTRY.size != at - start:
                raise NotPlain('an index has another length')
            if number in wanted:
                for second, rest, place in INDEX_ENTRY.iter_unpack(index[start:at]):
                    time = _TIME_FIELD + STAMP.pack(second, rest)
                    message = _message(*record_at(place), name, time)
                    yield BagMessage(second * 10**9 + rest, wanted[number], message)
        if left:
            raise NotPlain('an index is missing')

    def _opened_chunk(
        self, place: int, end: int
    ) -> Tuple[Callable[[int], Tuple[bytes, int]], bytes]:
        """Return what reads a message's record by its place in the chunk, and the chunk's index.

        The record begins at a place of the bytes that are returned. A chunk that is large, such as
        one with images, is read by pieces.
        """
        if end - place > _AT_ONCE:
            head = self._part(place, place + _PIECE)
            (length,) = UINT32.unpack_from(head, 0)
            if _NOT_COMPRESSED in head[4 : 4 + length] and _IS_CHUNK in head[4 : 4 + length]:
                start, (size,) = place + 8 + length, UINT32.unpack_from(head, 4 + length)
                if start + size > end or size != uint32_field(
                    parse_fields(head[4 : 4 + length]), 'size'
                ):
                    raise NotPlain('a chunk has another length')
                piece_at = partial(self._piece, start, start + size)
                return piece_at, self._part(start + size, end)
        if end - place > _LARGEST_CHUNK:
            raise NotPlain('a large chunk')
        whole = self._part(place, end)
        data, at = _content(whole)
        return (lambda place: (data, place)), whole[at:]

    def _piece(self, start: int, end: int, place: int) -> Tuple[bytes, int]:
        """Return the record at a place of a chunk whose messages stand from `start` to `end`."""
        piece = self._part(start + place, min(end, start + place + _PIECE))
        (length,) = UINT32.unpack_from(piece, 0)
        (size,) = UINT32.unpack_from(piece, 4 + length)
        if 8 + length + size > len(piece):
            piece = self._part(start + place, min(end, start + place + 8 + length + size))
        return piece, 0


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


def _content(whole: bytes) -> Tuple[bytes, int]:
    """Return the messages of a chunk, and where its index begins."""
    (length,) = UINT32.unpack_from(whole, 0)
    if _NOT_COMPRESSED in whole[4 : 4 + length]:  # as most are
        size_field, start, end = _found(whole, 0, _IS_CHUNK, _SIZE_FIELD, UINT32.size)
        if UINT32.unpack(size_field[-UINT32.size :]) != (end - start,):
            raise NotPlain('a chunk has another length')
        return whole[start:end], end
    record = _record(whole, 0, OP_CHUNK)
    return _opened(record, whole[record.start : record.end]), record.end


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


def _found(data: bytes, at: int, kind: bytes, name: bytes, size: int) -> Tuple[bytes, int, int]:
    """Return a field of the record that begins at a place, and where its data is.

    It is for records whose fields are numbers: no value looks like a name there.

    :param kind: the field of its header that names the kind of record.
    :param name: the beginning of the field: its length, its name, and what follows.
    :param size: of its value, in bytes.
    """
    (length,) = UINT32.unpack_from(data, at)
    start = at + 4 + length
    header = data[at + 4 : start]
    found = header.find(name)
    (content,) = UINT32.unpack_from(data, start)
    field = header[found : found + len(name) + size]
    is_whole = len(field) == len(name) + size and start + 4 + content <= len(data)
    if found < 0 or kind not in header or not is_whole:
        raise NotPlain('a record of another kind, or cut off')
    return field, start + 4, start + 4 + content


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
