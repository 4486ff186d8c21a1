"""Mends the bags of recorders that died, so that they can be read.

Only files that this package's recorder made (they say so in their header, or in their name where
that is damaged) and that no living process holds (their writer's lock is gone) are touched: `rosbag
record` names its files alike.

`NAME.bag.active` is copied, as far as it can be read, to `NAME.bag.mending`. Then it is renamed to
`NAME.bag.damaged` and the copy to `NAME.bag`. When that has been read back, the damaged one goes.
If the process is killed at any moment, the next start goes on from there.
"""

import fcntl
import os
import re
import time
from typing import BinaryIO, Callable, List, NamedTuple, Optional

from smach_oracle import bag_format
from smach_oracle.bag_format import BagFormatError
from smach_oracle.forking import unlock

from .bag_mending import Saved, contents, mend, read_back

ACTIVE_SUFFIX, DAMAGED_SUFFIX = '.bag.active', '.bag.damaged'
OUR_NAME = re.compile(r'(^|/)\d{8}T\d{6}\.\d{3}Z_[^/]*\.bag\.(active|damaged)$')
JUST_MADE_S = 10.0
_FIELDS_OF_OTHERS = {'op', 'index_pos', 'conn_count', 'chunk_count'}  # what rosbag itself writes

Log = Callable[[str], None]


class _Tools(NamedTuple):
    info: Log
    warn: Log


def recover_folder(folder: str, info: Log, warn: Log) -> List[str]:
    """Turn the orphaned `.bag.active` files of a folder into `.bag` files.

    A file that cannot be mended is left as it is and named in a warning. So is what was lost.

    :returns: the paths of the mended bags.
    :raises OSError: where the folder cannot be listed.
    """
    recovered = []
    tools = _Tools(info, warn)
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        if not name.endswith((ACTIVE_SUFFIX, DAMAGED_SUFFIX)):
            continue
        try:
            target = _recover(path, tools)
        except OSError as err:
            warn('The bag {} of a recorder that died cannot be mended: {}'.format(path, err))
            continue
        if target is not None:
            recovered.append(target)
    return recovered


def _recover(path: str, tools: _Tools) -> Optional[str]:
    try:
        bag = open(path, 'r+b')
    except FileNotFoundError:
        return None  # its recorder closed it meanwhile
    with bag:
        try:
            fcntl.flock(bag.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None  # it is being written
        try:
            if not _is_still_at(bag, path) or not _is_ours(bag):
                return None
            if not path.endswith(DAMAGED_SUFFIX):
                return _mend(bag, path, tools)
            return _go_on(bag, path, tools)
        finally:
            unlock(bag.fileno())


def _mend(bag: BinaryIO, path: str, tools: _Tools) -> Optional[str]:
    target = path[: -len('.active')]
    if os.path.exists(target) or os.path.exists(target + '.damaged'):
        target = free_name(target)
    saved = mend(bag, target + '.mending')
    if not saved.messages:
        os.unlink(target + '.mending')
        _leave_empty(bag, path, saved, tools.warn)
        return None
    os.rename(path, target + '.damaged')
    try:
        os.rename(target + '.mending', target)
    except OSError:
        os.rename(target + '.damaged', path)
        raise
    _drop_damaged(target, saved, tools)
    return target


def _leave_empty(bag: BinaryIO, path: str, saved: Saved, warn: Log) -> None:
    """Remove a file whose writer was killed before its first message. Any other one stays."""
    size = os.fstat(bag.fileno()).st_size
    if size <= bag_format.BAG_HEADER_END or _begins_with_a_torn_chunk(bag, saved):
        os.unlink(path)
    else:
        warn(
            'Nothing can be read in the bag {} of a recorder that died; it is left as it is'.format(
                path
            )
        )


def _begins_with_a_torn_chunk(bag: BinaryIO, saved: Saved) -> bool:
    """Whether the file ends inside its first chunk, and nothing else is wrong with it."""
    if saved.bytes_lost:
        return False
    size = os.fstat(bag.fileno()).st_size
    bag.seek(bag_format.BAG_HEADER_END)
    try:
        is_chunk = bag_format.op_of(bag_format.read_header(bag, size)) == bag_format.OP_CHUNK
        claimed = bag_format.UINT32.unpack(bag_format.read_exactly(bag, 4))[0]
    except BagFormatError:
        return size < bag_format.BAG_HEADER_END + len(bag_format.pack_chunk_header(0))
    return is_chunk and bag.tell() + claimed > size


def _go_on(bag: BinaryIO, path: str, tools: _Tools) -> Optional[str]:
    """Finish what another recorder began before it died."""
    target = path[: -len('.damaged')]
    if os.path.exists(target):
        _drop_damaged(target, contents(bag), tools)
        return target
    active = target + '.active'
    if os.path.exists(active):
        return None
    os.rename(path, active)
    return _mend(bag, active, tools)


def _drop_damaged(target: str, saved: Saved, tools: _Tools) -> None:
    """Remove the damaged bag, once the mended one has been read back."""
    try:
        read_back(target, saved)
        _sync_folder(os.path.dirname(target))
    except OSError as err:
        tools.warn(
            'The mended bag {} cannot be read back, its original stays as {}.damaged: {}'.format(
                target, target, err
            )
        )
        return
    os.unlink(target + '.damaged')
    losses = saved.losses()
    (tools.warn if saved.bytes_lost else tools.info)(
        'Mended the bag of a recorder that died: {}, {} messages{}'.format(
            target, saved.messages, losses and '; lost: ' + losses
        )
    )


def _sync_folder(folder: str) -> None:
    """Make the disk hold the names of the files, before one of them is removed."""
    handle = os.open(folder or '.', os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _is_still_at(bag: BinaryIO, path: str) -> bool:
    """Whether the file was not renamed between opening and locking it."""
    try:
        return os.path.samestat(os.fstat(bag.fileno()), os.stat(path))
    except FileNotFoundError:
        return False


def _is_ours(bag: BinaryIO) -> bool:
    status = os.fstat(bag.fileno())
    has_our_name = bool(OUR_NAME.search(bag.name))
    if status.st_size == 0:  # killed between making it and its header, unless it was made just now
        return has_our_name and time.time() - status.st_mtime > JUST_MADE_S
    bag.seek(len(bag_format.MAGIC))
    try:
        fields = bag_format.read_header(bag, bag_format.HEADER_RECORD_SIZE)
    except BagFormatError:
        return has_our_name  # the header is torn or damaged
    if fields.get(bag_format.WRITER_FIELD) == bag_format.WRITER_NAME:
        return True
    return has_our_name and set(fields) != _FIELDS_OF_OTHERS


def free_name(path: str) -> str:
    """Return `path`, or `..._2.bag`, `..._3.bag` and so on where it exists.

    A name is taken where a bag of that name is there, being written or being mended.
    """
    stem, number = path[: -len('.bag')], 1
    while any(os.path.exists(path + suffix) for suffix in ('', '.active', '.damaged')):
        number += 1
        path = '{}_{}.bag'.format(stem, number)
    return path
