"""Writes rosbag 2.0 files so that a crash or a full disk costs at most the chunk in memory.

rosbag.Bag opens a chunk on disk and patches its length in afterwards, keeps an index entry of every
message in memory until it is closed, and is left undefined by a failing write. A recorder beside a
robot wants the opposite: here a chunk is put together in memory and appended whole, with its index,
at a known end. A failing write is cut off again, so that what was written stays a valid bag. Memory
holds one chunk, and some ten bytes for each chunk before it. Chunks 1, 2, 4, 8 and so on repeat all
connections: where the first chunk is damaged, the messages of later ones still have a type.
"""

import errno
import fcntl
import os
import struct
from itertools import chain
from typing import Dict, List, NamedTuple, Optional, Tuple

from smach_oracle import bag_format
from smach_oracle.bag_format import ChunkInfo, Stamp
from smach_oracle.forking import in_child, let_go_of, unlock

MAX_CHUNK_BYTES = 768 * 1024  # rosbag's own figure

# some network and FUSE file systems: better a bag that no other recorder can mend than none
_NO_LOCKS_HERE = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


class MessageType(NamedTuple):
    """The type of messages, as a connection record holds it."""

    name: str  # e.g. smach_oracle/OracleEvent
    md5sum: str
    definition: str  # full text, with the types it depends on


class _Connection(NamedTuple):
    number: int
    record: bytes
    message_header: bytes  # up to the value of its last field, which is the time


_TIME_AND_SIZE = struct.Struct('<III')  # s, ns, bytes of the data
_Key = Tuple[str, str, str]  # of a connection: topic, md5sum, callerid
_Entries = List[Tuple[int, int, int]]  # s, ns, offset in the chunk


def _lock(fd: int) -> None:
    """Lock a file that was just made.

    A recorder that starts locks each file for a moment, to see whether its writer is alive. It lets
    an empty one go, so this waits for it and for nobody else.
    """
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
    except OSError as err:
        if err.errno not in _NO_LOCKS_HERE:
            raise


class BagWriter:
    """One bag file being written. Not thread-safe: one thread writes.

    The file is locked (flock) while it is open, which is how a recorder that starts knows a file
    that is being written from one whose writer died. On a file system without locks it is written
    unlocked.
    """

    def __init__(self, path: str) -> None:
        """Create the file and write its header.

        :raises OSError: where that cannot be done. FileExistsError where it is there already.
        """
        self.path = path
        self._connections: Dict[_Key, _Connection] = {}
        self._chunks: List[ChunkInfo] = []
        self._end = bag_format.BAG_HEADER_END
        self._reset_chunk()
        self._fd = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_CLOEXEC, 0o644)
        try:
            _lock(self._fd)
            _write_at(self._fd, bag_format.MAGIC + bag_format.pack_bag_header(0, 0, 0), 0)
        except OSError:
            unlock(self._fd)
            os.close(self._fd)
            os.unlink(path)  # holds nothing
            raise
        in_child(self._let_go)

    def _let_go(self) -> None:
        # a child that outlives its parent would keep the lock, and the bag would not be mended
        if self._fd >= 0:
            let_go_of(self._fd)

    @property
    def has_chunks(self) -> bool:
        """Whether anything but the header has reached the file."""
        return bool(self._chunks)

    def add(
        self,
        topic: str,
        message_type: MessageType,
        stamp: Stamp,
        data: bytes,
        details: Optional[Dict[str, str]] = None,
    ) -> int:
        """Put a message, serialised to `data`, into the chunk in memory. Touches no disk.

        :param details: further fields of the connection header (latching, callerid).
        :returns: the size of the chunk in memory, in bytes.
        """
        key = (topic, message_type.md5sum, details.get('callerid', '') if details else '')
        in_chunk = self._in_chunk.get(key)
        if in_chunk is None:
            in_chunk = self._connection(key, message_type, details or {}), []
            self._in_chunk[key] = in_chunk
        connection, entries = in_chunk
        seconds, nanoseconds = stamp
        offset = len(self._buffer)
        self._buffer += (
            connection.message_header + _TIME_AND_SIZE.pack(seconds, nanoseconds, len(data)) + data
        )
        entries.append((seconds, nanoseconds, offset))  # a message that failed has no entry
        return len(self._buffer)

    def _connection(
        self, key: _Key, message_type: MessageType, details: Dict[str, str]
    ) -> _Connection:
        connection = self._connections.get(key)
        if connection is None:
            number = len(self._connections)
            fields = {
                'type': message_type.name,
                'md5sum': message_type.md5sum,
                'message_definition': message_type.definition,
                **details,
            }
            record = bag_format.pack_connection(number, key[0], fields)
            connection = _Connection(number, record, _message_header(number))
            self._connections[key] = connection
            self._buffer += connection.record
        return connection

    def flush(self) -> None:
        """Hand the chunk in memory to the operating system.

        From here on the messages survive the death of this process (not that of the machine: see
        `sync`).

        :raises OSError: where the disk does not take it. The file then ends where it did before.
        """
        entries = {each.number: of_it for each, of_it in self._in_chunk.values() if of_it}
        if not entries:
            return
        position = self._end
        chunk = bytes(self._buffer)
        indexes, info = _pack_indexes(entries, position)
        self._append(bag_format.pack_chunk_header(len(chunk)) + chunk + indexes)
        self._chunks.append(info)
        self._reset_chunk()
        if _is_power_of_two(len(self._chunks)):
            self._buffer += b''.join(item.record for item in self._connections.values())

    def sync(self) -> None:
        """Make the disk hold what was flushed.

        :raises OSError: where it does not.
        """
        os.fsync(self._fd)

    def close(self, sync: bool = True) -> None:
        """Flush, write the index and close.

        :param sync: return only when the disk holds it.
        :raises OSError: where the disk does not take it. The file is then closed, unindexed, and
            can be repaired.
        """
        try:
            self.flush()
            write_bag_index(
                self._fd,
                self._end,
                [item.record for item in self._connections.values()],
                self._chunks,
            )
            if sync:
                self.sync()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is, without an index. The chunk in memory is lost."""
        if self._fd >= 0:
            fd, self._fd = self._fd, -1
            unlock(fd)
            os.close(fd)

    def _reset_chunk(self) -> None:
        self._buffer = bytearray()
        self._in_chunk: Dict[_Key, Tuple[_Connection, _Entries]] = {}  # messages in the chunk

    def _append(self, data: bytes) -> None:
        try:
            _write_at(self._fd, data, self._end)
        except OSError:
            _cut_off(self._fd, self._end)
            raise
        self._end += len(data)


def _pack_indexes(by_connection: Dict[int, _Entries], position: int) -> Tuple[bytes, ChunkInfo]:
    """Return the index records behind a chunk at a position of the file, and what is in it."""
    records = []
    for number, entries in by_connection.items():
        entries.sort()  # ROS time may jump back
        packed = struct.pack('<{}I'.format(3 * len(entries)), *chain.from_iterable(entries))
        records.append(bag_format.pack_index(number, len(entries), packed))
    start = min(entries[0][:2] for entries in by_connection.values())
    end = max(entries[-1][:2] for entries in by_connection.values())
    counts = {number: len(entries) for number, entries in by_connection.items()}
    return b''.join(records), ChunkInfo(position, start, end, counts)


def write_bag_index(fd: int, end: int, connections: List[bytes], chunks: List[ChunkInfo]) -> None:
    """Write the bag's index at `end` and point the bag header to it.

    A power cut in here can leave a header that points to nothing: repairing therefore never trusts
    an index, it makes a new one.

    :raises OSError: where the disk does not take it. The file is then cut off at `end`.
    """
    try:
        _write_at(
            fd, b''.join(connections) + b''.join(map(bag_format.pack_chunk_info, chunks)), end
        )
    except OSError:
        _cut_off(fd, end)
        raise
    _write_at(
        fd, bag_format.pack_bag_header(end, len(connections), len(chunks)), len(bag_format.MAGIC)
    )


def _message_header(connection: int) -> bytes:
    """A message record's header up to the value of its last field, which is the time."""
    whole = bag_format.pack_header(
        {
            'op': bytes((bag_format.OP_MESSAGE,)),
            'conn': bag_format.UINT32.pack(connection),
            'time': bytes(8),
        }
    )
    return whole[:-8]


def _is_power_of_two(number: int) -> bool:
    return number & (number - 1) == 0


def _write_at(fd: int, data: bytes, position: int) -> None:
    rest = memoryview(data)
    while rest:
        written = os.pwrite(fd, rest, position)
        position += written
        rest = rest[written:]


def _cut_off(fd: int, end: int) -> None:
    try:
        os.ftruncate(fd, end)
    except OSError:
        pass  # a torn tail costs nothing: `rosbag reindex` and bag_repair leave it out
