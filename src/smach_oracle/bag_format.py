"""Records of the rosbag 2.0 file format (wiki.ros.org/Bags/Format/2.0), packed and parsed.

    BagFormatError (an OracleError): the bytes are no bag, or not the part of one that was expected

A record is a header (fields of `name=value`) and data, each behind its length as a little-endian
uint32. All offsets and sizes are in bytes. Pure: no ROS, no file is opened here.
"""

import struct
from typing import BinaryIO, Dict, List, NamedTuple, Tuple, Union

from smach_oracle.oracle.errors import OracleError

MAGIC = b'#ROSBAG V2.0\n'
OP_MESSAGE, OP_BAG_HEADER, OP_INDEX, OP_CHUNK, OP_CHUNK_INFO, OP_CONNECTION = 2, 3, 4, 5, 6, 7
HEADER_RECORD_SIZE = 4096  # header and padding of the bag header record, without the two lengths
BAG_HEADER_END = len(MAGIC) + 8 + HEADER_RECORD_SIZE
# An additional field in the bag header, which readers ignore. It marks the recorder's own files.
WRITER_FIELD, WRITER_NAME = 'recorder', b'smach_oracle'

UINT32 = struct.Struct('<I')
UINT64 = struct.Struct('<Q')
STAMP = struct.Struct('<II')
INDEX_ENTRY = struct.Struct('<III')  # s, ns, offset in the chunk
COUNT_ENTRY = struct.Struct('<II')  # connection, messages

Stamp = Tuple[int, int]  # s, ns
Fields = Dict[str, bytes]


class BagFormatError(OracleError):
    """The bytes are no bag, or not the part of one that was expected."""


class ChunkInfo(NamedTuple):
    """The place of a chunk in the file, and its content."""

    position: int  # in the file
    start: Stamp
    end: Stamp
    counts: Dict[int, int]  # messages by connection


def pack_header(fields: Dict[str, Union[bytes, str]]) -> bytes:
    """Pack a header behind its length."""
    parts: List[bytes] = []
    for name, value in fields.items():
        field = name.encode() + b'=' + (value if isinstance(value, bytes) else value.encode())
        parts.append(UINT32.pack(len(field)) + field)
    header = b''.join(parts)
    return UINT32.pack(len(header)) + header


def pack_record(fields: Dict[str, Union[bytes, str]], data: bytes) -> bytes:
    """Pack a record."""
    return pack_header(fields) + UINT32.pack(len(data)) + data


def pack_bag_header(index_position: int, connections: int, chunks: int) -> bytes:
    """Pack the bag header record, padded so that it can be overwritten in place.

    Index position 0 means: no index.
    """
    header = pack_header(
        {
            'op': bytes((OP_BAG_HEADER,)),
            'index_pos': UINT64.pack(index_position),
            'conn_count': UINT32.pack(connections),
            'chunk_count': UINT32.pack(chunks),
            WRITER_FIELD: WRITER_NAME,
        }
    )
    padding = HEADER_RECORD_SIZE - (len(header) - 4)
    return header + UINT32.pack(padding) + b' ' * padding


def pack_connection(connection: int, topic: str, details: Dict[str, str]) -> bytes:
    """Pack a connection record.

    :param details: the fields of the connection header (type, md5sum, message_definition).
    """
    data = pack_header({'topic': topic, **details})
    return (
        pack_header(
            {'op': bytes((OP_CONNECTION,)), 'topic': topic, 'conn': UINT32.pack(connection)}
        )
        + data
    )


def pack_chunk_header(size: int) -> bytes:
    """Pack the header of an uncompressed chunk of `size` bytes, with the length of its data."""
    return pack_header(
        {'op': bytes((OP_CHUNK,)), 'compression': 'none', 'size': UINT32.pack(size)}
    ) + UINT32.pack(size)


def pack_index(connection: int, count: int, entries: bytes) -> bytes:
    """Pack the index of one connection in one chunk. Entries are packed INDEX_ENTRYs."""
    return pack_record(
        {
            'op': bytes((OP_INDEX,)),
            'ver': UINT32.pack(1),
            'conn': UINT32.pack(connection),
            'count': UINT32.pack(count),
        },
        entries,
    )


def pack_chunk_info(info: ChunkInfo) -> bytes:
    """Pack a chunk info record of the bag's index."""
    return pack_record(
        {
            'op': bytes((OP_CHUNK_INFO,)),
            'ver': UINT32.pack(1),
            'chunk_pos': UINT64.pack(info.position),
            'start_time': STAMP.pack(*info.start),
            'end_time': STAMP.pack(*info.end),
            'count': UINT32.pack(len(info.counts)),
        },
        b''.join(COUNT_ENTRY.pack(*item) for item in info.counts.items()),
    )


def stamp_at(data: bytes, offset: int) -> Stamp:
    """Return the stamp at an offset."""
    seconds, nanoseconds = STAMP.unpack_from(data, offset)
    return seconds, nanoseconds


def parse_fields(header: bytes) -> Fields:
    """Parse a header without its length.

    :raises BagFormatError: where it is damaged.
    """
    fields: Fields = {}
    position = 0
    while position < len(header):
        if position + 4 > len(header):
            raise BagFormatError('a header ends inside a field length')
        size = UINT32.unpack_from(header, position)[0]
        name, equals, value = header[position + 4 : position + 4 + size].partition(b'=')
        position += 4 + size
        if position > len(header) or not equals:
            raise BagFormatError('a header field is damaged')
        fields[name.decode('ascii', 'replace')] = value
    return fields


def read_exactly(source: BinaryIO, size: int) -> bytes:
    """Read `size` bytes.

    :raises BagFormatError: where the file ends before.
    """
    data = source.read(size)
    if len(data) != size:
        raise BagFormatError('the file ends {} bytes early'.format(size - len(data)))
    return data


def read_header(source: BinaryIO, limit: int) -> Fields:
    """Read the header of the record at the file's position.

    A header longer than `limit` bytes (what is left of the file) is damage, not a reason to
    allocate it.

    :raises BagFormatError: where it is damaged.
    """
    size = UINT32.unpack(read_exactly(source, 4))[0]
    if size > limit:
        raise BagFormatError('a header claims {} bytes'.format(size))
    return parse_fields(read_exactly(source, size))


def op_of(fields: Fields) -> int:
    """Return the op code of a record.

    :raises BagFormatError: where it has none.
    """
    value = fields.get('op', b'')
    if len(value) != 1:
        raise BagFormatError('a record has no op code')
    return value[0]


def uint32_field(fields: Fields, name: str) -> int:
    """Return a uint32 field of a record's header.

    :raises BagFormatError: where it has no such field.
    """
    value = fields.get(name, b'')
    if len(value) != 4:
        raise BagFormatError('a record lacks the field {!r}'.format(name))
    return int(UINT32.unpack(value)[0])
