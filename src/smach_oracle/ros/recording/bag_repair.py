"""Gives the bags of recorders that died an index, so that they can be read.

Only files that this package's recorder made (they say so in their header) and that no living
process holds (their writer's lock is gone) are touched: `rosbag record` names its files alike.
"""
import fcntl
import os
import re
import time
from typing import BinaryIO, Callable, Dict, List, NamedTuple, Optional, Tuple

from . import bag_format
from .bag_format import BagFormatError, ChunkInfo, Fields, Stamp
from .bag_writer import write_bag_index

ACTIVE_SUFFIX = '.bag.active'
OUR_NAME = re.compile(r'(^|/)\d{8}T\d{6}\.\d{3}Z_[^/]*\.bag\.active$')
JUST_MADE_S = 10.0


class _Scan(NamedTuple):
    end: int  # of the last complete chunk and its index
    connections: List[bytes]  # records
    chunks: List[ChunkInfo]


def recover_folder(folder: str, info: Callable[[str], None], warn: Callable[[str],
                                                                           None]) -> List[str]:
    """Turn the orphaned `.bag.active` files of a folder into `.bag` files.

    A file that cannot be mended is left as it is and named in a warning.

    :returns: the paths of the mended bags.
    :raises OSError: where the folder cannot be listed.
    """
    recovered = []
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        if not name.endswith(ACTIVE_SUFFIX):
            continue
        try:
            target = _recover(path)
        except (OSError, BagFormatError) as err:
            warn('The bag {} of a recorder that died cannot be mended: {}'.format(path, err))
            continue
        if target is not None:
            info('Mended the bag of a recorder that died: {}'.format(target))
            recovered.append(target)
    return recovered


def _recover(path: str) -> Optional[str]:
    try:
        bag = open(path, 'r+b')
    except FileNotFoundError:
        return None  # its recorder closed it meanwhile
    with bag:
        try:
            fcntl.flock(bag.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None  # it is being written
        if not _is_still_at(bag, path) or not _is_ours(bag):
            return None
        if not repair(bag):
            os.unlink(path)  # killed before its first message
            return None
        target = path[:-len('.active')]
        if os.path.exists(target):
            target = free_name(target)
        os.rename(path, target)
    return target


def _is_still_at(bag: BinaryIO, path: str) -> bool:
    """Whether the file was not renamed between opening and locking it."""
    try:
        return os.path.samestat(os.fstat(bag.fileno()), os.stat(path))
    except FileNotFoundError:
        return False


def _is_ours(bag: BinaryIO) -> bool:
    status = os.fstat(bag.fileno())
    if status.st_size == 0:  # killed between making it and its header, unless it was made just now
        return bool(OUR_NAME.search(bag.name)) and time.time() - status.st_mtime > JUST_MADE_S
    try:
        return _read_bag_header(bag).get(bag_format.WRITER_FIELD) == bag_format.WRITER_NAME
    except BagFormatError:
        return False


def _read_bag_header(bag: BinaryIO) -> Fields:
    bag.seek(0)
    if bag.read(len(bag_format.MAGIC)) != bag_format.MAGIC:
        raise BagFormatError('it is no bag of version 2.0')
    fields = bag_format.read_header(bag, bag_format.HEADER_RECORD_SIZE)
    if bag_format.op_of(fields) != bag_format.OP_BAG_HEADER:
        raise BagFormatError('it has no bag header')
    return fields


def repair(bag: BinaryIO) -> bool:
    """Cut a bag (open 'r+b', uncompressed) off after its last whole chunk and index it anew.

    :returns: whether there is a message in it.
    :raises BagFormatError: where it is not a bag.
    :raises OSError: where the disk does not take it.
    """
    size = os.fstat(bag.fileno()).st_size
    if size:
        _read_bag_header(bag)
    if size < bag_format.BAG_HEADER_END:
        return False
    scan = _scan(bag)
    bag.truncate(scan.end)
    write_bag_index(bag.fileno(), scan.end, scan.connections, scan.chunks)
    os.fsync(bag.fileno())
    return bool(scan.chunks)


def _scan(bag: BinaryIO) -> _Scan:
    size = os.fstat(bag.fileno()).st_size
    connections: Dict[int, bytes] = {}
    chunks: List[ChunkInfo] = []
    end = bag_format.BAG_HEADER_END
    while end < size:
        bag.seek(end)
        try:
            chunk, end = _read_chunk(bag, size, connections)
        except BagFormatError:
            break  # torn by the crash
        chunks.append(chunk)
    return _Scan(end, [connections[number] for number in sorted(connections)], chunks)


def _read_chunk(bag: BinaryIO, size: int, connections: Dict[int, bytes]) -> Tuple[ChunkInfo, int]:
    """Read the chunk at the file's position.

    :returns: the chunk, and where its last index record ends.
    """
    position = bag.tell()
    if bag_format.op_of(bag_format.read_header(bag, size)) != bag_format.OP_CHUNK:
        raise BagFormatError('no chunk at {}'.format(position))
    data_size = bag_format.UINT32.unpack(bag_format.read_exactly(bag, 4))[0]
    data_position = bag.tell()
    bag.seek(data_size, os.SEEK_CUR)
    info, end, is_last = _read_indexes(bag, position, size)
    if is_last or set(info.counts) - set(connections):  # else the messages need not be read
        bag.seek(data_position)
        found, messages = _look_into(bag_format.read_exactly(bag, data_size))
        if messages != sum(info.counts.values()):
            raise BagFormatError('the index of the chunk at {} is torn'.format(position))
        connections.update(found)
    if set(info.counts) - set(connections):
        raise BagFormatError('messages without a connection at {}'.format(position))
    return info, end


def _read_indexes(bag: BinaryIO, chunk_position: int, size: int) -> Tuple[ChunkInfo, int, bool]:
    """Read the index records at the file's position.

    :returns: their contents, where they end, and whether nothing sound follows.
    """
    counts: Dict[int, int] = {}
    stamps: List[Stamp] = []
    end = bag.tell()
    while True:
        try:
            fields = bag_format.read_header(bag, size)
            if bag_format.op_of(fields) != bag_format.OP_INDEX:
                is_last = False
                break
            entries = bag_format.read_exactly(
                bag,
                bag_format.UINT32.unpack(bag_format.read_exactly(bag, 4))[0])
            if len(entries) < bag_format.INDEX_ENTRY.size:
                raise BagFormatError('an index without entries')
        except BagFormatError:
            is_last = True
            break
        stamps += [
            bag_format.stamp_at(entries, 0),
            bag_format.stamp_at(entries, len(entries) - bag_format.INDEX_ENTRY.size)
        ]
        counts[bag_format.uint32_field(fields, 'conn')] = bag_format.uint32_field(fields, 'count')
        end = bag.tell()
    if not counts:
        raise BagFormatError('the chunk at {} has no index'.format(chunk_position))
    return ChunkInfo(chunk_position, min(stamps), max(stamps), counts), end, is_last


def _look_into(chunk: bytes) -> Tuple[Dict[int, bytes], int]:
    """The connection records of a chunk, and how many messages it holds."""
    connections: Dict[int, bytes] = {}
    messages = position = 0
    while position + 4 <= len(chunk):
        header_end = position + 4 + bag_format.UINT32.unpack_from(chunk, position)[0]
        if header_end + 4 > len(chunk):
            raise BagFormatError('a chunk ends inside a record')
        fields = bag_format.parse_fields(chunk[position + 4:header_end])
        end = header_end + 4 + bag_format.UINT32.unpack_from(chunk, header_end)[0]
        if bag_format.op_of(fields) == bag_format.OP_CONNECTION:
            connections[bag_format.uint32_field(fields, 'conn')] = chunk[position:end]
        else:
            messages += 1
        position = end
    return connections, messages


def free_name(path: str) -> str:
    """`path`, or `..._2.bag`, `..._3.bag` and so on.

    A name is taken where a bag of that name is there or being written.
    """
    stem, number = path[:-len('.bag')], 1
    while os.path.exists(path) or os.path.exists(path + '.active'):
        number += 1
        path = '{}_{}.bag'.format(stem, number)
    return path
