"""Reads a sound bag by its index: only the chunks that have what is wanted, and in these no more.

It is for speed. rosbags reads each index and each header of a bag, whatever is wanted of it. What
is seldom (lz4, no index) or not as it should be raises NotPlain, and is left to rosbags, which says
what is wrong. Format: ROS bag 2.0 (http://wiki.ros.org/Bags/Format/2.0).
"""

import bz2
import os
import struct
from collections import deque
from types import TracebackType
from typing import Callable, Deque, Dict, Iterable, List, Mapping, NamedTuple, Optional, Tuple, Type

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
_MOST_KNOWN, _LONGEST_KNOWN = 8, 1 << 18  # beginnings of indexes, and their bytes
_MOST_NUMBERS = 1000  # headers
# what a file that is not sound makes the code raise
_NOT_SOUND = (
    ArithmeticError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    ValueError,
    BagFormatError,
    struct.error,
)
_UNPACK_UINT32 = UINT32.unpack_from

# of a message: what unpacks header, time and size, and the header up to the time. b'': not known
_RecordLayout = Tuple[struct.Struct, bytes]
_NO_RECORD: _RecordLayout = (struct.Struct(''), b'')


class NotPlain(Exception):
    """The bag has something that is not read here."""


class PlainConnection(NamedTuple):
    """A topic, and the type of its messages."""

    order: int  # among those of the bag
    topic: str
    msgtype: str  # as rosbags writes it: PACKAGE/msg/NAME
    msgdef: str
    md5sum: str  # of the definition, in hexadecimal digits


# a message as it was recorded: its stamp in ns, the order of its connection, its number among
# those that were found, its connection, and some bytes, with where in them its own begin and end
BagMessage = Tuple[int, int, int, PlainConnection, bytes, int, int]


class _RawRecord(NamedTuple):
    fields: Fields
    start: int  # of its data, in the bytes that it was read from
    end: int


class _Chunk(NamedTuple):
    place: int
    counts: Mapping[int, int]  # of messages by connection


class KnownHeaders:
    """Parts that many bags have alike, by their bytes. Each is parsed once."""

    def __init__(self) -> None:
        self._connections: Deque[_KnownConnections] = deque(maxlen=_MOST_KNOWN)
        self._numbers: Dict[bytes, int] = {}  # of connections, by the header of an index
        self._records: Dict[int, _RecordLayout] = {}  # by the number of the connection

    def connections(self, tail: bytes, count: int) -> Tuple[Mapping[int, PlainConnection], int]:
        """Return the connections of an index, by number, and where they end.

        :param count: how many there are.
        :raises NotPlain: where a record is of another kind, or cut off.
        """
        for known in self._connections:
            if len(known.by_number) == count and tail.startswith(known.told):
                return known.by_number, len(known.told)
        by_number, at = _connections_in(tail, count)
        if len(by_number) == count and at <= _LONGEST_KNOWN:
            self._connections.appendleft(_KnownConnections(tail[:at], by_number))
        return by_number, at

    def connection_of(self, index: bytes, at: int) -> Tuple[int, int, int]:
        """Return the connection of the index at a place, and where its entries begin and end.

        :raises NotPlain: where the record is of another kind, or cut off.
        """
        (length,) = _UNPACK_UINT32(index, at)
        start = at + 4 + length
        header = index[at:start]
        number = self._numbers.get(header)
        if number is None:
            name, begin, end = _found(index, at, _IS_INDEX, _CONNECTION_FIELD, UINT32.size)
            (number,) = UINT32.unpack(name[-UINT32.size :])
            if len(self._numbers) == _MOST_NUMBERS:
                self._numbers.clear()
            self._numbers[header] = number
            return number, begin, end
        (size,) = _UNPACK_UINT32(index, start)
        end = start + 4 + size
        if end > len(index):
            raise NotPlain('a record is cut off')
        return number, start + 4, end

    def find_messages(
        self,
        data: bytes,
        entries: Iterable[Tuple[int, ...]],
        number: int,
        connection: PlainConnection,
        found: List[BagMessage],
    ) -> None:
        """Add messages of one connection to those that were found.

        :param entries: of its index: s, ns, and where in the data the message's record begins.
        :param number: of the connection.
        :raises NotPlain: where an entry leads to no message of the connection.
        """
        layout, head = self._records.get(number, _NO_RECORD)
        order = connection.order
        name = _CONNECTION_FIELD + UINT32.pack(number)
        for second, rest, place in entries:
            if head:
                told, told_s, told_ns, size = layout.unpack_from(data, place)
                start = place + layout.size
                end = start + size
            if not head or not (
                told == head and told_s == second and told_ns == rest and end <= len(data)
            ):
                time = _TIME_FIELD + STAMP.pack(second, rest)
                start, end = _message(data, place, name, time)
                layout, head = _record_layout(data[place : start - 4])
                self._records[number] = layout, head
            stamp = second * 10**9 + rest
            found.append((stamp, order, len(found), connection, data, start, end))


class _KnownConnections(NamedTuple):
    told: bytes
    by_number: Mapping[int, PlainConnection]


class IndexedBag:
    """A bag that is open for reading."""

    def __init__(self, path: str, known: Optional[KnownHeaders] = None) -> None:
        """Read its index.

        :param known: parts of bags that were read before.
        :raises NotPlain: where rosbags is to read it.
        :raises OSError: where it cannot be opened.
        """
        self.connections: Mapping[int, PlainConnection] = {}
        self._known = known or KnownHeaders()
        self._chunks: List[_Chunk] = []
        self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            self._read_index()
        except BaseException as err:
            os.close(self._file)
            if isinstance(err, _NOT_SOUND):
                raise NotPlain(repr(err)) from err
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
        found: List[BagMessage] = []
        try:
            for chunk, end in zip(self._chunks, ends):
                if not wanted.keys().isdisjoint(chunk.counts):
                    self._find_messages(chunk, end, wanted, found)
        except _NOT_SOUND as err:
            raise NotPlain(repr(err)) from err
        found.sort()  # by their first fields. The third one is another in each
        return found

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
        count = uint32_field(fields, 'conn_count')
        self.connections, at = self._known.connections(tail, count)
        for _ in range(uint32_field(fields, 'chunk_count')):
            place_field, start, at = _found(tail, at, _IS_CHUNK_INFO, _PLACE_FIELD, UINT64.size)
            (place,) = UINT64.unpack(place_field[-UINT64.size :])
            counts = {conn: count for conn, count in COUNT_ENTRY.iter_unpack(tail[start:at])}
            self._chunks.append(_Chunk(place, counts))
        self._chunks.sort()
        if at != len(tail) or not self._chunks:
            raise NotPlain('the index is not the end of it')

    def _find_messages(
        self,
        chunk: _Chunk,
        end: int,
        wanted: Mapping[int, PlainConnection],
        found: List[BagMessage],
    ) -> None:
        """Find the messages of a chunk. Its index comes behind it, up to `end`."""
        whole, pieces, index = self._opened_chunk(chunk.place, end)
        left, at = dict(chunk.counts), 0
        while at < len(index):
            number, start, at = self._known.connection_of(index, at)
            if left.pop(number, 0) * INDEX_ENTRY.size != at - start:
                raise NotPlain('an index has another length')
            if number in wanted:
                entries = INDEX_ENTRY.iter_unpack(index[start:at])
                if pieces is None:
                    self._known.find_messages(whole, entries, number, wanted[number], found)
                    continue
                for second, rest, place in entries:
                    data, at_piece = pieces.read(place)
                    entry = ((second, rest, at_piece),)
                    self._known.find_messages(data, entry, number, wanted[number], found)
        if left:
            raise NotPlain('an index is missing')

    def _opened_chunk(self, place: int, end: int) -> Tuple[bytes, Optional['_Pieces'], bytes]:
        """Return the messages of a chunk, or what reads pieces of it, and the chunk's index.

        A chunk that is large, such as one with images, is read by pieces.
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
                return b'', _Pieces(self._part, start, start + size), self._part(start + size, end)
        if end - place > _LARGEST_CHUNK:
            raise NotPlain('a large chunk')
        whole = self._part(place, end)
        data, at = _content(whole)
        return data, None, whole[at:]


class _Pieces:
    """Reads the records of a chunk by pieces. Small ones that lie together are in one piece."""

    def __init__(self, part: Callable[[int, int], bytes], start: int, end: int) -> None:
        """`part`: reads a part of the file. `start`, `end`: of the chunk's messages in it."""
        self._part = part
        self._start = start
        self._end = end
        self._piece = b''
        self._from = 0  # of the piece, in the chunk

    def read(self, place: int) -> Tuple[bytes, int]:
        """Return a piece in which the record at a place of the chunk is whole, and where there."""
        at = place - self._from
        if not (at >= 0 and self._is_whole(at)):
            self._take(place, _PIECE)
            at = 0
            if not self._is_whole(at):
                (length,) = UINT32.unpack_from(self._piece, 0)
                (size,) = UINT32.unpack_from(self._piece, 4 + length)
                self._take(place, 8 + length + size)
        return self._piece, at

    def _is_whole(self, at: int) -> bool:
        """Whether the record at a place of the piece is all in it."""
        room = len(self._piece) - at - 8  # for its header and data, each behind its length
        if room < 0:
            return False
        (length,) = UINT32.unpack_from(self._piece, at)
        if length > room:
            return False
        (size,) = UINT32.unpack_from(self._piece, at + 4 + length)
        return bool(length + size <= room)

    def _take(self, place: int, size: int) -> None:
        begin = self._start + place
        self._piece, self._from = self._part(begin, min(self._end, begin + size)), place


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


def _record_layout(header: bytes) -> _RecordLayout:
    """Return a layout of a message's record whose header is as this one, except for its time.

    There is none where the time does not come last.
    """
    head = header[: -STAMP.size]
    if not head.endswith(_TIME_FIELD):
        return _NO_RECORD
    return struct.Struct('<{}sIII'.format(len(head))), head


def _message(data: bytes, at: int, connection: bytes, time: bytes) -> Tuple[int, int]:
    """Return where the data of a message are, whose record begins at a place of a chunk.

    :param connection: the field of its header that names it.
    :param time: the field that tells its time.
    """
    (length,) = UINT32.unpack_from(data, at)
    start = at + 4 + length
    header = data[at + 4 : start]
    (size,) = UINT32.unpack_from(data, start)
    sound = connection in header and time in header and _IS_MESSAGE in header
    if not sound or start + 4 + size > len(data):
        raise NotPlain('an index leads to no message of its connection')
    return start + 4, start + 4 + size


def _connections_in(tail: bytes, count: int) -> Tuple[Dict[int, PlainConnection], int]:
    """Return the connections with which an index begins, and where they end."""
    found: Dict[int, PlainConnection] = {}
    at = 0
    for _ in range(count):
        record = _record(tail, at, OP_CONNECTION)
        number = uint32_field(record.fields, 'conn')
        about = parse_fields(tail[record.start : record.end])
        found[number] = PlainConnection(
            len(found),
            record.fields['topic'].decode(),
            about['type'].decode().replace('/', '/msg/'),
            about['message_definition'].decode(),
            about['md5sum'].decode(),
        )
        at = record.end
    return found, at
