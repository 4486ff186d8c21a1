"""Locks of the folder of a rates file, and of the names that machines use in that file.

The file is written under the lock of its folder. A machine of a running program claims its name by
a lock on one byte of the folder. A lock leaves no file behind, and ends with the machine or its
process. Programs on other computers do not see it: a network file system keeps the locks of folders
to each computer.
"""

import contextlib
import errno
import fcntl
import hashlib
import os
import struct
import time
import weakref
from typing import Dict, Iterator, MutableMapping, Tuple

from smach_oracle.forking import in_child, let_go_of, unlock

from ..identity import WeakIdentityMap

# of Linux: locks of an open file, which the process does not lose as it closes the folder elsewhere
_F_OFD_GETLK, _F_OFD_SETLK = 36, 37
_LOCK = struct.Struct('hhqqi4x')  # struct flock: kind, origin, start, length, process
Key = Tuple[str, str]  # path of the file, name


class _NameLock:
    """The lock of one name. It lasts as long as this object, which its owners share."""

    def __init__(self, key: Key) -> None:
        """Lock it.

        :raises OSError: where there is no such folder, or no such lock.
        """
        descriptor = os.open(os.path.dirname(key[0]), os.O_RDONLY | os.O_CLOEXEC)
        self._end = weakref.finalize(self, _unlock, descriptor, key)
        self._end.atexit = False
        self._descriptor, self._folder = descriptor, os.fstat(descriptor)
        in_child(self._leave_to_parent)
        _ask(descriptor, _F_OFD_SETLK, fcntl.F_RDLCK, key)

    def is_on(self, folder: str) -> bool:
        """Whether it locks the folder that is at a path now.

        :raises OSError: where none is there.
        """
        return self._end.alive and os.path.samestat(self._folder, os.stat(folder))

    def _leave_to_parent(self) -> None:
        if self._end.detach():
            let_go_of(self._descriptor)


# No lock guards these: an owner may go at any point, and two claims of one name do no harm.
_by_key: 'MutableMapping[Key, _NameLock]' = weakref.WeakValueDictionary()
_by_owner: 'WeakIdentityMap[object, Dict[Key, _NameLock]]' = WeakIdentityMap()


def claim(path: str, name: str, owner: object) -> None:
    """Claim a name in a rates file, as long as its owner lives.

    Where there is no such folder, or no such lock, nothing is claimed, and the next call tries
    again.
    """
    key = os.path.realpath(path), name
    claims = _by_owner.get(owner)
    if claims is None:
        claims = _by_owner[owner] = {}
    with contextlib.suppress(OSError):
        found = _by_key.get(key)
        if found is None or not found.is_on(os.path.dirname(key[0])):
            found = _by_key[key] = _NameLock(key)
        claims[key] = found


def is_claimed(path: str, name: str, if_unknown: bool) -> bool:
    """Whether a running program uses a name. `if_unknown`: on a file system without locks."""
    key = os.path.realpath(path), name
    try:
        descriptor = os.open(os.path.dirname(key[0]), os.O_RDONLY | os.O_CLOEXEC)
        try:
            return _ask(descriptor, _F_OFD_GETLK, fcntl.F_WRLCK, key) != fcntl.F_UNLCK
        finally:
            os.close(descriptor)
    except OSError:
        return if_unknown


def _ask(descriptor: int, command: int, kind: int, key: Key) -> int:
    """Set or look at the lock of a name, and return the kind that is there."""
    text = '{}/{}'.format(os.path.basename(key[0]), key[1]).encode('utf-8', 'replace')
    place = int.from_bytes(hashlib.blake2b(text, digest_size=7).digest(), 'big')
    told = fcntl.fcntl(descriptor, command, _LOCK.pack(kind, os.SEEK_SET, place, 1, 0))
    return int(_LOCK.unpack(told)[0])


def _unlock(descriptor: int, key: Key) -> None:
    with contextlib.suppress(OSError):  # a child may have the folder open, too
        _ask(descriptor, _F_OFD_SETLK, fcntl.F_UNLCK, key)
    os.close(descriptor)


WAIT_S = 2.0  # who holds it writes one small file
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EBADF, errno.EINVAL)  # such as on some networks


@contextlib.contextmanager
def folder_lock(folder: str) -> Iterator[None]:
    """Hold the lock of a folder, against other threads and processes.

    On a file system that has no locks the body runs without one.

    :raises OSError: where there is no such folder, or another holds the lock for too long.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _lock(descriptor, folder, time.monotonic() + WAIT_S)
        yield
    finally:
        unlock(descriptor)
        os.close(descriptor)


def _lock(descriptor: int, folder: str, until_s: float) -> None:
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as err:
            if err.errno in _NO_LOCKS:
                return
            if err.errno not in (errno.EWOULDBLOCK, errno.EACCES, errno.EINTR):
                raise
            if time.monotonic() > until_s:
                raise OSError(
                    errno.EAGAIN, 'another program holds the lock of the folder', folder
                ) from None
        time.sleep(0.005)
