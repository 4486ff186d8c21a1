"""Reads what can be read of a bag that is cut off or damaged.

A sound bag is a chain of records, each of which says where the next begins. Where the chain breaks,
the file is searched on for the next record that parses, inside a chunk as well. Index records are
passed over: whoever saves the messages makes new ones. Opens no file, needs no ROS.
"""

import os
from typing import BinaryIO, Iterator, NamedTuple, Optional

from smach_oracle import bag_format
from smach_oracle.bag_format import BagFormatError, Fields

_FIRST_FIELD = bag_format.UINT32.pack(4) + b'op='  # with which every header of ours begins
_LONGEST_HEADER = 65536  # bytes. A topic's name is its longest part
_BLOCK = 1 << 20  # bytes read at once
_FIELD_SIZES = {
    bag_format.OP_MESSAGE: {'conn': 4, 'time': 8},
    bag_format.OP_INDEX: {'conn': 4, 'count': 4},
    bag_format.OP_CHUNK: {'size': 4},
    bag_format.OP_CHUNK_INFO: {'chunk_pos': 8, 'count': 4},
    bag_format.OP_CONNECTION: {'conn': 4},
}


class Record(NamedTuple):
    """A record whose header is sound."""

    op: int
    fields: Fields
    position: int  # in the file, as are the next two
    data_start: int
    end: int


class Found(NamedTuple):
    """A message or a connection that was found."""

    record: Record
    data: bytes
    is_sure: bool  # another record follows it, so that its length is right


class Salvage:
    """The messages and connections of a bag, in the order of the file, and how much is lost."""

    def __init__(self, source: BinaryIO) -> None:
        self.bytes_lost = 0
        self.places_lost = 0  # each in another chunk, or larger than one
        self.torn_bytes = 0  # at the end of the file, where its writer died
        self._window = _Window(source)
        self._size = self._window.size
        self._is_place_open = False  # whether the present chunk has lost something already

    def read(self) -> Iterator[Found]:
        """Search the whole file.

        :raises OSError: where the disk cannot be read.
        """
        position = bag_format.BAG_HEADER_END
        record = self._record_at(position)
        while position < self._size:
            if record is None:
                position = self._skip(position, position + 1)
                record = self._record_at(position)
                continue
            following = self._record_at(record.end)
            is_sure = following is not None or record.end == self._size
            if not is_sure and self._find(record.data_start) < record.end:
                position = self._skip(position, record.data_start)  # it is shorter than it says
                record = self._record_at(position)
                continue
            if record.op in (bag_format.OP_MESSAGE, bag_format.OP_CONNECTION):
                yield Found(
                    record,
                    self._window.read(record.data_start, record.end - record.data_start),
                    is_sure,
                )
            elif record.op == bag_format.OP_CHUNK:
                self._is_place_open = False
            position, record = record.end, following

    def lose(self, size: int) -> None:
        """Count a record that was found and is of no use."""
        self.bytes_lost += size
        self.places_lost += not self._is_place_open
        self._is_place_open = True

    def _skip(self, position: int, search_from: int) -> int:
        following = self._find(search_from)
        if following == self._size:
            self.torn_bytes = following - position
        else:
            self.lose(following - position)
        return following

    def _find(self, position: int) -> int:
        """Return where the next record begins, at `position` or behind it, else the file's size."""
        while True:
            found = self._window.find(_FIRST_FIELD, position + 4)
            if found < 0:
                return self._size
            if self._record_at(found - 4) is not None:
                return found - 4
            position = found - 3

    def _record_at(self, position: int) -> Optional[Record]:
        """The record at a position, or None where there is none that fits into the file.

        A chunk ends, here, where its data begin: the records in it follow.
        """
        start = position + 4
        data_start = start + self._uint32(position) + 4
        if not start + 4 < data_start <= min(self._size, start + _LONGEST_HEADER):
            return None
        try:
            fields = bag_format.parse_fields(self._window.read(start, data_start - 4 - start))
            op = bag_format.op_of(fields)
        except BagFormatError:
            return None
        sizes = _FIELD_SIZES.get(op)
        if sizes is None or any(len(fields.get(name, b'')) != size for name, size in sizes.items()):
            return None
        end = data_start
        if op != bag_format.OP_CHUNK:
            end += self._uint32(data_start - 4)
        return Record(op, fields, position, data_start, end) if end <= self._size else None

    def _uint32(self, position: int) -> int:
        data = self._window.read(position, 4)
        return int(bag_format.UINT32.unpack(data)[0]) if len(data) == 4 else 0


class _Window:
    """Reads a file by large blocks. Not mapped into memory: a disk error would end the process."""

    def __init__(self, source: BinaryIO) -> None:
        self.size = os.fstat(source.fileno()).st_size
        self._source = source
        self._start = 0
        self._block = b''

    def read(self, position: int, size: int) -> bytes:
        """Return at most `size` bytes. There are fewer at the end of the file."""
        offset = position - self._start
        if offset < 0 or offset + size > len(self._block):
            self._source.seek(position)
            self._block = self._source.read(max(size, _BLOCK))
            self._start, offset = position, 0
        return self._block[offset : offset + size]

    def find(self, pattern: bytes, position: int) -> int:
        """Return where the pattern is, from `position` on. -1 means nowhere."""
        while position + len(pattern) <= self.size:
            self.read(position, len(pattern))
            found = self._block.find(pattern, position - self._start)
            if found >= 0:
                return self._start + found
            position = self._start + len(self._block) - len(pattern) + 1
        return -1
